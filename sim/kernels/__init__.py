"""Compiled inner loops that compute several individuals (parameter sets of one wing) at a time.

The last axis of the arrays, of length W = LANES, is the individual; its elements are called lanes. Only ``sim`` uses
these functions. The arithmetic of every lane has a fixed order, so that the results of an individual do not depend on
the other lanes or on the size of the batch.
"""

from wingfit.sim.kernels.processor import lanes

LANES = lanes()
