"""Calibrations on forces: coefficients by condition, a global model, agreement with the recordings."""
