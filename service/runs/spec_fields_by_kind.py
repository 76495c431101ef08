"""Which settings of a run belong to which kind of dataset, and which only to a search."""

from __future__ import annotations

WING_ONLY = ("division", "bounds_factor", "accuracy_mm", "outputs")
VEHICLE_ONLY = ("preset", "without", "axes", "low_pass_hz", "peel_width_beats")
# Gauss-Newton draws nothing: it has no population, and it ends by its own rule.
SEARCH_ONLY = ("population", "stall", "tolerance", "finish")
