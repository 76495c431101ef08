"""Markers in one image: candidates, sub-pixel position by the fit of a pattern, and its covariance."""
