"""Measures the checks of datasets: deliberate mistakes must be caught, and good datasets must pass."""
