"""Compares plans with simulated campaigns: standard errors with the scatter of estimates, effects with tests."""
