"""Determine where and when model and recordings differ, and which missing load would explain the difference."""
