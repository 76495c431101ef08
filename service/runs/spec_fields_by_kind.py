"""Names of settings of a run that apply only to one kind of dataset, or only to some of the methods."""

from __future__ import annotations

WING_ONLY = ("division", "search_division", "bounds_factor", "accuracy_mm", "outputs")
VEHICLE_ONLY = ("preset", "without", "axes", "low_pass_hz", "peel_width_beats")
# Gauss-Newton has no population, and its own convergence criterion.
SEARCH_ONLY = ("population", "stall", "tolerance", "finish")
# By method, those that mean nothing for it; the method auto ends with Gauss-Newton in any case.
IDLE = {"gauss_newton": SEARCH_ONLY, "auto": ("finish",)}
