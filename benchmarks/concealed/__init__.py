"""Blind test of the diagnosis: simulated recordings with hidden physics, diagnosed without knowledge of the answers."""
