"""Write a calibrated model as Python that needs no wingfit: a file with numpy alone, or a package with numba."""
