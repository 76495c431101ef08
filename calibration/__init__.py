"""Calibration: find the genes with which a model reproduces recordings."""
