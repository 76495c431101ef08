"""Uploaded datasets, read and kept in memory."""
