"""Measurements of the simulated physics, and reference solutions."""
