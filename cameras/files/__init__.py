"""Files of calibrated cameras: that of wingfit, and those of DLTdv, easyWand, OpenCV and Anipose."""
