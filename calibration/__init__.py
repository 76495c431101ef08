"""Calibration: searches the values of genes with which a model reproduces recordings best."""
