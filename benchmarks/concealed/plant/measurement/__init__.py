"""Simulated cameras and balances: they turn a motion or forces into a recording with noise, gaps and faults."""
