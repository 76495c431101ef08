"""Faults of a balance."""
