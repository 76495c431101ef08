"""Replacements for the compiled kernels in an exported file: the same functions on numpy arrays.

In the exported file they stand in for modules of :mod:`wingfit.sim.kernels`, so that the laws of a vehicle, which are
copied without a change, run without a compiler.
"""
