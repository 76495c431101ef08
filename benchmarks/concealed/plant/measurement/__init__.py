"""Cameras and balances: from a motion to a recording, with noise, gaps and faults."""
