"""Concealed trials: recordings with hidden physics, sealed answers, and the diagnosis run as a user runs it."""
