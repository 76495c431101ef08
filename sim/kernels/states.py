"""Integrate the internal states of effects within a step, together with the motion of the bodies.

A state z of a connector's axis depends on the relative twist r along it, z' = g(z, r), and causes a wrench -f(z). With
u = dg/dr, b = -dg/dz, k = df/dz at the start of the step and theta = 1 / (1 / (h gamma) + b) (h: step), the increment
of z in a stage is U_z = theta (r_z + u U_r), r_z being the rate of z with the coupling to earlier stages, U_r the
increment of r. In the equation of motion, from which z is thus eliminated, this is a damper k theta u and a wrench -k
theta r_z. States of laws of the air act through forces that change little within a step; for them U_z = theta r_z.
"""

from __future__ import annotations

from wingfit.records.array_types import Array
from wingfit.sim.kernels.arrays import DECAY, DRIVE, PULL, Laws, Wiring, Work
from wingfit.sim.kernels.connectors import add_turned, push_apart, twists
from wingfit.sim.kernels.jit import allocating, kernel
from wingfit.sim.kernels.lanes.vector import load, load1, store, store1


@kernel
def combine_states(base: Array, U: Array, coefficient: Array, count: int, out: Array) -> None:
    """Set ``out`` [Z, W] to ``base`` + sum_s coefficient[s] U[s] over the first ``count`` stages; U [., Z, W]."""
    for i in range(len(out)):
        total = load1(base, i)
        for s in range(count):
            total += coefficient[s] * load(U, s, i)
        store1(out, i, total)


@allocating
def keep_tangents(laws: Laws, wiring: Wiring, length: float, work: Work) -> None:
    """Store the states' derivatives at the start of a step in ``work.z_tangent0``, and add the dampers k theta u.

    For the symbols, see this module. Row DECAY of the copy holds theta instead of b; ``length`` is h gamma. The dampers
    are added to ``work.more_d0``.
    """
    work.z_tangent0[:] = work.z_tangent
    for i in range(len(work.z)):
        store(work.z_tangent0, DECAY, i, 1.0 / (load(work.z_tangent, DECAY, i) + 1.0 / length))
    count = len(wiring.first)
    for law in laws.connector:
        for k in range(law[2]):
            axis, at = laws.axes[law[5] + k], law[4] + k * count
            for c in range(count):
                damper = load(work.z_tangent0, PULL, at + c) * load(work.z_tangent0, DECAY, at + c)
                damper = damper * load(work.z_tangent0, DRIVE, at + c)
                store(work.more_d0, c, axis, load(work.more_d0, c, axis) + damper)


@kernel
def start_states(wiring: Wiring, laws: Laws, step: float, coupling: Array, stage: int, work: Work) -> None:
    """Set ``work.z_known`` [Z, W] to r_z of a stage, and add the connectors' wrenches -k theta r_z to ``work.wrench``.

    For the symbols, see this module. ``coupling``: coefficients of the earlier stages; ``step``: h, s.
    """
    for i in range(len(work.z)):
        total = load1(work.z_rate, i)
        for s in range(stage):
            total += (coupling[s] / step) * load(work.U_z, s, i)
        store1(work.z_known, i, total)
    if len(laws.connector) == 0:
        return
    work.push[:] = 0.0
    count = len(wiring.first)
    for law in laws.connector:
        for k in range(law[2]):
            axis, at = laws.axes[law[5] + k], law[4] + k * count
            for c in range(count):
                pull = load(work.z_tangent0, PULL, at + c) * load(work.z_tangent0, DECAY, at + c)
                store(work.push, c, axis, load(work.push, c, axis) + pull * load1(work.z_known, at + c))
    push_apart(wiring.first, wiring.second, wiring.a, wiring.b, work.Q0, work.d0, work.push, work.wrench)


@kernel
def finish_states(wiring: Wiring, laws: Laws, work: Work, stage: int) -> None:
    """Set the increments ``work.U_z`` of a stage, once ``U_xi`` and ``U_V`` of the same stage are known."""
    for i in range(len(work.z)):
        store(work.U_z, stage, i, load(work.z_tangent0, DECAY, i) * load1(work.z_known, i))
    if len(laws.connector) == 0:
        return
    count = len(wiring.first)
    twists(wiring.first, wiring.second, wiring.a, wiring.b, work.Q0, work.d0, work.U_V[stage], work.push)
    add_turned(wiring.first, wiring.second, wiring.a, wiring.b, work.Q0, work.d0, work.V0, work.U_xi[stage], work.push)
    for law in laws.connector:
        for k in range(law[2]):
            axis, at = laws.axes[law[5] + k], law[4] + k * count
            for c in range(count):
                driven = load(work.z_tangent0, DECAY, at + c) * load(work.z_tangent0, DRIVE, at + c)
                more = driven * load(work.push, c, axis)
                store(work.U_z, stage, at + c, load(work.U_z, stage, at + c) + more)
