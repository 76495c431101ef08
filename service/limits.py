"""Limits that the command line and the server share; imports nothing, so that the command line starts fast."""

MOST_WORKERS = 256
"""Worker processes of an evaluator; each takes some hundred megabytes."""
