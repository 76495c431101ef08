"""Calibration runs: requests, specification, computation, JSON answers, exports."""
