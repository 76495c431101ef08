"""Observation + recording -> misfit -> fitted genome."""
