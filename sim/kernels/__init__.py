"""The compiled inner loops: eight individuals side by side, the lane as the innermost array axis.

Nothing outside ``sim`` calls these; ``wingfit.sim.solver.simulate`` is the one door. Every lane does its own arithmetic
in a fixed order, so that an individual's numbers do not depend on its neighbours, its lane or the size of the batch.
"""

LANES = 8
