"""Cameras and tracks on videos whose truth is known: ``python -m benchmarks.cameras --json``."""
