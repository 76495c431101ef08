"""Build the inputs of the kernels for a condition (drive, initial state, setting) and arrays for the results."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from wingfit.records import Condition
from wingfit.records.array_types import Array
from wingfit.sim.atmosphere import density
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import PORTS, STAGES, Setting, State, Trace
from wingfit.sim.kernels.integrate import NODES, SLOPES
from wingfit.sim.kernels.lanes.memory import aligned, several, zeros
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.wing.drive import RodDrive
from wingfit.sim.wing.structure import Structure


def drive_table(
    rods: RodDrive, frequency: float, numerics: Numerics, n: int, beat: int, *, compliant: bool = False
) -> Array:
    """Return the motion of both rods [n, STAGES, 2, 3, W] at the stages of ``n`` steps of beat number ``beat``.

    The fourth axis is angle (rad), rate and acceleration (by s); W individuals. The amplitude grows over the first
    ``numerics.ramp_beats`` beats. The acceleration includes the Rosenbrock method's term for the explicit dependence on
    time. For a ``compliant`` drive the fourth axis has six entries instead of three: angle, four derivatives, and that
    term by itself. ``frequency``: of the beat, Hz. Tables are cached and must not be changed.
    """
    ramp = numerics.ramp_beats
    return _table(rods.series.tobytes(), rods.series.shape, frequency, ramp, n, min(beat, ramp), compliant)


@lru_cache(maxsize=16)
def _table(
    series: bytes, shape: tuple[int, ...], frequency: float, ramp_beats: int, n: int, beat: int, compliant: bool
) -> Array:
    rods = RodDrive(np.frombuffer(series, np.complex128).reshape(shape))
    omega = 2 * np.pi * frequency
    phases = (np.arange(n)[:, None] + NODES) / n
    angle = rods.angles(2 * np.pi * phases) * omega ** np.arange(5.0)[:, None]
    if beat < ramp_beats:
        angle[..., :4, :] = _ramped(angle, (beat + phases)[..., None, None] / ramp_beats, frequency / ramp_beats)
        angle[..., 4, :] = 0.0
    slope = SLOPES[:, None, None] / (n * frequency)
    share = slope * angle[:, :1, :, 3]  # explicit dependence on time, at the start of the step
    table = zeros((n, STAGES, 2, 6 if compliant else 3, LANES))
    if compliant:
        table[..., :5, :], table[..., 5, :] = angle, share
    else:
        table[...] = angle[..., :3, :]
        table[..., 2, :] += share
    return table


def _ramped(angle: Array, x: Array, rate: float) -> Array:
    """Multiply the angle and its first three derivatives by a smooth step from 0 at x = 0 to 1 at x = 1.

    ``angle`` [..., 5, W]: angle and four time derivatives; returns [..., 4, W]. ``x`` grows at ``rate`` (1/s).
    """
    x = np.minimum(x, 1.0)
    e = x**3 * (10 - 15 * x + 6 * x**2)
    e1 = rate * 30 * x**2 * (1 - x) ** 2
    e2 = rate**2 * 60 * x * (1 - x) * (1 - 2 * x)
    e3 = rate**3 * 60 * (1 - 6 * x + 6 * x**2) * (x < 1)
    a, a1, a2, a3, _ = np.moveaxis(angle, -2, 0)
    return np.stack(
        [e * a, e * a1 + e1 * a, e * a2 + 2 * e1 * a1 + e2 * a, e * a3 + 3 * (e1 * a2 + e2 * a1) + e3 * a], axis=-2
    )


def at_rest(structure: Structure, states: int = 0) -> State:
    """Return the initial state: bodies in their rest pose, rods horizontal, no motion, ``states`` zeros of effects."""
    n = len(structure.bodies)
    motion = (zeros((n + 2, 9, LANES)), zeros((n + 2, 3, LANES)), zeros((n + 2, 6, LANES)))
    state = State(*motion, zeros((states, LANES)))
    state.R[:, [0, 4, 8]] = 1.0
    hinge = structure.wing.hinge
    state.p[:n] = np.array([body.centre for body in structure.bodies])[:, :, None]
    state.p[n:] = np.array([0.0, hinge.y, hinge.z])[:, None]
    return state


def setting(condition: Condition, steps: int) -> Setting:
    """Return density, wind, gravity and step of a condition as input of the kernels, with ``steps`` per beat."""
    a = condition.angle_of_attack
    wind = condition.airspeed * np.array([np.cos(a), 0.0, np.sin(a)])
    step = 1.0 / (condition.flap_frequency * steps)
    rho = np.full(LANES, density(condition.pressure, condition.temperature))
    return Setting(aligned(rho), aligned(np.repeat(wind[:, None], LANES, axis=1)), condition.gravity, step)


def new_trace(structure: Structure, steps: int, *, with_motion: bool = False, states: int = 0) -> Trace:
    """Allocate results of one beat; motion, with this number of effects' ``states``, only if ``with_motion``."""
    rows, bodies = steps if with_motion else 0, len(structure.bodies) + 2
    shapes: dict[str, tuple[int, ...]] = {
        "tracks": (steps, len(structure.wing.markers), 3), "rods": (steps, 2, 6), "air": (steps, 3),
        "power": (steps, PORTS), "energy": (steps, 3),
        "R": (rows, bodies, 9), "p": (rows, bodies, 3), "V": (rows, bodies, 6), "z": (rows, states),
    }  # fmt: skip
    return Trace(**several(shapes))
