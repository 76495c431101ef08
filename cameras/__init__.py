"""From images of a wing to tracks of its markers: cameras, their calibration, detection, triangulation, smoothing.

SI units and radians; pixels count from the centre of the upper left one, x to the right and y down, as in OpenCV.
"""
