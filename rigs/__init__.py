"""Rigs that the user simulates: their contract, the faults and laws that any rig may hide, and the model of both."""
