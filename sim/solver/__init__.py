"""Compute the periodic motion of a batch of individuals (parameter sets of one wing) to a requested accuracy."""
