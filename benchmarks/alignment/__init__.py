"""Proves the alignment of tracks on wings of independent plants."""
