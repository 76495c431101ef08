"""Newton's and Euler's equations for every body of a wing, in world components and by finite differences."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wingfit.records import Condition
from wingfit.sim.kernels.arrays import State
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.outputs import Outputs

Array = npt.NDArray[np.float64]


def rate_of(series: Array, step: float) -> Array:
    """Rate of a periodic series at its samples, by the central difference of sixth order."""
    weights = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))
    total = sum(w * (np.roll(series, -k, axis=0) - np.roll(series, k, axis=0)) for k, w in weights)
    return np.asarray(total / step)


def newton_euler(model: FlexibleWing, outputs: Outputs, motion: State, condition: Condition) -> tuple[Array, Array]:
    """[n, N, 6] sum of the wrenches on every body in its frame, and rate of momentum by finite differences."""
    w, n = model.structure.wiring, len(model.structure.bodies)
    R = motion.R.reshape(len(motion.R), -1, 3, 3)
    applied = outputs.air_wrench + outputs.held
    down = np.array([0.0, 0.0, -condition.gravity])
    applied[:, :, 3:] += w.mass[:, None] * np.einsum("tnji,j->tni", R[:, :n], down)
    for c, load in enumerate(outputs.connectors):
        i, j = w.first[c], w.second[c]
        moment, force = load.wrench[:, :3], load.wrench[:, 3:]
        held = motion.p[:, j] + np.einsum("tij,j->ti", R[:, j], w.b[c])
        world_force, world_moment = (np.einsum("tij,tj->ti", R[:, i], x) for x in (force, moment))
        for body, sign in ((i, -1.0), (j, 1.0)):
            if body < n:
                about = world_moment + np.cross(held - motion.p[:, body], world_force)
                both = np.stack([about, world_force], axis=1)
                applied[:, body] += sign * np.einsum("tji,tkj->tki", R[:, body], both).reshape(-1, 6)
    step = 1 / (condition.flap_frequency * len(motion.V))
    V = motion.V[:, :n]
    inertia = w.inertia.reshape(n, 3, 3)
    spin = np.einsum("nij,tnj->tni", inertia, V[:, :, :3])
    momentum = np.concatenate([spin, w.mass[:, None] * V[:, :, 3:]], axis=2)
    turning = np.concatenate(
        [np.cross(V[:, :, :3], spin), w.mass[:, None] * np.cross(V[:, :, :3], V[:, :, 3:])], axis=2
    )
    return applied, rate_of(momentum, step) + turning
