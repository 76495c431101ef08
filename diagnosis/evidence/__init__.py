"""Whitened recordings, fits of hypotheses, and score tests."""
