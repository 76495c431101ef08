"""Benchmarks of the published claims: ``python -m benchmarks.NAME --json`` prints a JSON object as its last line."""
