"""Diagnoses of real recordings whose missing physics others document: ``python -m benchmarks.real``."""
