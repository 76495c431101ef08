"""Benches: a plant with its cameras or balance, behind one interface."""
