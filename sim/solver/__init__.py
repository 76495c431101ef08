"""Computes the periodic motion of a batch of individuals to a requested accuracy."""
