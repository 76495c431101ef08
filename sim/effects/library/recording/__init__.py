"""Faults of recordings of any kind, in their clock or their scale."""
