"""The noise of a recording, fits of hypotheses, and score tests."""
