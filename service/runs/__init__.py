"""Calibration runs: specification, computation, schemas, exports."""
