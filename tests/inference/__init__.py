"""Tests of the estimation tools on problems with known answers."""
