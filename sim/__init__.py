"""Simulators: they turn a rig, a genome, a condition and effects into a simulated recording."""
