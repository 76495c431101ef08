"""Quasi-steady blade elements of wings that move as prescribed (Armanini et al. 2016)."""
