"""Diagnoses: specification, computation, schemas, exports."""
