"""Calibrations on forces: coefficients for each condition, a global model, agreement with the recordings."""
