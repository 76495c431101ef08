"""Faults of cameras and of the tracking of markers."""
