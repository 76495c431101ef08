"""Parsed datasets."""
