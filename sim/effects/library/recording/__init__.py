"""Faults of a recording of any kind: its clock and its scale."""
