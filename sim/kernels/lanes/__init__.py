"""Arithmetic on a group of lanes inside kernels: vectors, matrices, functions and memory."""
