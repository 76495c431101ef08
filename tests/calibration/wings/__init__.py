"""Calibrations of wings that are described in other ways than by foam and rods."""
