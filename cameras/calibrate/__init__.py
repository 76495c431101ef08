"""Calibration of two to eight cameras from images of a chessboard, or from the tracks of a wand.

All unknowns (lenses, poses of cameras, poses of the board or wand) are estimated together, so that the covariance of
the cameras follows from the scatter of the residuals.
"""
