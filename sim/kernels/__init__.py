"""Compiled inner loops for eight individuals at a time; the last axis of the arrays is the individual, called lane.

Only ``sim`` uses these. The arithmetic of every lane has a fixed order, so that the results of an individual do not
depend on the other lanes or on the size of the batch.
"""

LANES = 8
