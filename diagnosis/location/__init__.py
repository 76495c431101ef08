"""Where and when model and recordings differ, and the missing load that would explain it."""
