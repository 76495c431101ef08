"""Datasets of the server, parsed."""
