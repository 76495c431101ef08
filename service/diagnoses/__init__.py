"""Diagnoses: requests, specification, computation, JSON answers, exports."""
