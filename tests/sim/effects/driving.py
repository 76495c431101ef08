"""A wing under one effect of its drive: its rods alone, and a wing too stiff to bend."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from tests.sim.effects.bench import beat_of
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import new_work
from wingfit.sim.kernels.integrate import advance
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.solver.scene import at_rest, drive_table, new_trace
from wingfit.sim.virtual_rigs.campaign import robird_wing, vacuum
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.structure import Structure, build

Array = npt.NDArray[np.float64]

SLOW = replace(vacuum(0.01, 0.0, 0.25), gravity=0.0)  # so slow that a stiff wing does not bend
STIFF = {"E_f": 3e7, "E_r": 6e11, "G_f": 1.1e7, "G_r": 1.5e10}


class Rods(NamedTuple):
    """Both rods at the end of n steps of one beat, integrated from the exact start of each; and their exact flap angle.

    Rotation [n, 2, 3, 3], place of the rod's frame [n, 2, 3] (m), twist [n, 2, 6] in its own axes; angle and its
    first derivative by time [n, 2, 2].
    """

    R: Array
    p: Array
    V: Array
    angle: Array


@cache
def robird() -> Structure:
    return build(robird_wing(), Division.parse("4"))


def rods_of(scene: WingScene, steps: int) -> Rods:
    """How the drive moves the rods of a scene within each of ``steps`` of a beat."""
    wiring, here, lanes = scene.structure.wiring, scene.setting(steps), scene.frozen()
    frequency, n = scene.condition.flap_frequency, len(wiring.mass)
    table = drive_table(scene.rods, frequency, Numerics(steps=steps), steps, 1)
    work, alive = new_work(wiring, here, lanes), np.ones(LANES, bool)
    R, p, V = np.zeros((steps, 2, 9)), np.zeros((steps, 2, 3)), np.zeros((steps, 2, 6))
    for t in range(steps):
        state, trace = at_rest(scene.structure), new_trace(scene.structure, 1)
        advance(wiring, here, lanes, table[t : t + 1], work, state, trace, alive)
        R[t], p[t], V[t] = state.R[n:, :, 0], state.p[n:, :, 0], state.V[n:, :, 0]
    angle = scene.rods.angles(2 * np.pi * np.arange(1, steps + 1) / steps)[:, :, :2, 0]
    return Rods(R.reshape(steps, 2, 3, 3), p, V, angle * [1.0, 2 * np.pi * frequency])


def off_axis(rods: Rods, axis: Array, place: Array) -> tuple[float, float]:
    """Largest distance of pose (rad, m) and twist (rad/s, m/s) from rigid rotation about ``axis`` through ``place``.

    At angle zero a rod's frame stands at the hinge of the wing's description.
    """
    hinge = robird().wing.hinge
    lever = np.array([0.0, hinge.y, hinge.z]) - place
    angle, rate = rods.angle[..., 0].ravel(), rods.angle[..., 1].ravel()
    turn = Rotation.from_rotvec(np.outer(angle, axis))
    moved = Rotation.from_matrix(rods.R.reshape(-1, 3, 3)) * turn.inv()
    pose = np.concatenate([moved.as_rotvec(), rods.p.reshape(-1, 3) - place - turn.apply(lever)], axis=1)
    spin = np.outer(rate, axis)
    twist = np.concatenate([spin, turn.inv().apply(np.cross(spin, turn.apply(lever)))], axis=1)
    return float(np.abs(pose).max()), float(np.abs(rods.V.reshape(-1, 6) - twist).max())


def stiff_tracks(name: str, steps: int = 64, **values: float) -> Array:
    """Markers [n, M, 3] of a wing that hardly bends, flapped slowly in vacuum."""
    return beat_of(name, SLOW, steps, "4", STIFF, **values).tracks


def turned(structure: Structure, angle: Array, axis: Array, place: Array) -> Array:
    """Where the markers [n, M, 3] of a rigid wing are at ``angle`` [n] about ``axis`` through ``place``."""
    rest = np.array([marker.position for marker in structure.wing.markers]) - place
    return np.stack([place + Rotation.from_rotvec(a * axis).apply(rest) for a in angle])
