"""Quasi-steady blade elements of wings with prescribed motion (Armanini et al. 2016)."""
