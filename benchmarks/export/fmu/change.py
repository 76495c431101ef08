"""Compare an FMU of a wing with wingfit's kernels while flap frequency, phase lag and stream change.

The kernels get the angles of the driving rods from a table, which is made here with numpy: the flap frequency follows
its input as documented, the phase is its integral in closed form.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.export.fmu.importer import Fmu
from benchmarks.export.fmu.steady import BEATS, Errors, inputs_at, percent
from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.fmu.variables import SMOOTHING
from wingfit.records import Condition
from wingfit.records.array_types import Array
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import STAGES, new_work
from wingfit.sim.kernels.integrate import NODES, SLOPES, advance
from wingfit.sim.kernels.lanes.memory import zeros
from wingfit.sim.solver.scene import at_rest, new_trace
from wingfit.sim.virtual_rigs.campaign import blank_recording
from wingfit.sim.wing.drive import RodDrive
from wingfit.sim.wing.flexible_wing import FlexibleWing

LASTS = 3.0  # beats at the first frequency
FINER = 2  # steps of the kernels in one communication step


def change_errors(model: CalibratedModel, fmu: Fmu, first: Condition, second: Condition) -> Errors:
    """Return the errors of markers and air force during and after a change from one condition to another.

    The wing has no effects whose laws depend on the flap frequency.
    """
    wing = model.simulation()
    assert isinstance(wing, FlexibleWing)  # noqa: S101
    genome, per_beat = model.genome(first), 324
    dt, count = 1.0 / (first.flap_frequency * per_beat), int(LASTS * per_beat)
    markers = [f"marker.{one.name}.{axis}" for one in wing.wing.markers for axis in "xyz"]
    running = fmu.started(inputs_at(first, model))
    for _ in range(BEATS * per_beat):
        running.step(dt)
    running.set(inputs_at(second, model))
    found = running.series([*markers, *(f"air_force.{axis}" for axis in "xyz")], dt, count)
    running.close()
    tracks, air = _by_kernels(wing, genome, first, second, dt / FINER, count * FINER)
    apart = np.linalg.norm(found[:, :-3].reshape(count, -1, 3) - tracks[::FINER], axis=2).max()
    # the stream changes at once: at the first instant the FMU still shows the force before the change
    return Errors(1e3 * float(apart), percent(found[1:, -3:], air[FINER::FINER]))


def _by_kernels(
    wing: FlexibleWing, genome: tuple[float, ...], first: Condition, second: Condition, dt: float, count: int
) -> tuple[Array, Array]:
    """Markers [count, M, 3] and air force [count, 3] from the motion at ``first``, with the inputs of ``second``."""
    fine = replace(wing, numerics=replace(wing.numerics, steps=648, periodic=1e-7))
    motion = fine.beat(genome, blank_recording(wing.wing, first), with_motion=True).motion
    if motion is None:
        raise AssertionError("a beat without its motion")
    scene = wing.scene(genome, second)
    lanes, setting = scene.frozen(), scene.setting(1)._replace(step=dt)
    state, trace = at_rest(scene.structure, 0), new_trace(scene.structure, count)
    for array, value in zip(state, motion, strict=True):
        array[...] = value[0][..., None]
    work, alive = new_work(scene.structure.wiring, setting, lanes), np.ones(LANES, bool)
    advance(scene.structure.wiring, setting, lanes, _table(wing, first, second, dt, count), work, state, trace, alive)
    if not alive.all():
        raise AssertionError("the wing diverged")
    return trace.tracks[..., 0].copy(), trace.air[..., 0].copy()


def _table(wing: FlexibleWing, first: Condition, second: Condition, dt: float, count: int) -> Array:
    """Motion of both rods [count, STAGES, 2, 3, W] at the stages of the steps."""
    t = (np.arange(count)[:, None] + NODES) * dt
    turn = [2 * np.pi * one for one in _followed(first.flap_frequency, second.flap_frequency, t)]
    lag = _followed(first.phase_lag, second.phase_lag, t)
    table, rods = zeros((count, STAGES, 2, 3, LANES)), RodDrive.of(wing.wing.drive, 0.0, 1)
    for rod in range(2):
        # phase and its first three derivatives by time
        p0, p1, p2, p3 = (turn[k] - rod * lag[k + 1] for k in range(4))
        a0, a1, a2, a3 = np.moveaxis(rods.angles(p0)[..., 0, :4, 0], -1, 0)
        table[:, :, rod, 0] = a0[..., None]
        table[:, :, rod, 1] = (a1 * p1)[..., None]
        jerk = a3 * p1**3 + 3 * a2 * p1 * p2 + a1 * p3
        table[:, :, rod, 2] = (a2 * p1**2 + a1 * p2 + SLOPES * dt * jerk[:, :1])[..., None]
    return table


def _followed(before: float, after: float, t: Array) -> list[Array]:
    """Integral, value and first three derivatives of what follows an input from ``before`` to ``after`` at t = 0."""
    time = float(SMOOTHING.start or 0.0)
    x, left, apart = t / time, np.exp(-t / time), before - after
    return [
        after * t + apart * time * (2.0 - (2.0 + x) * left),
        after + apart * (1.0 + x) * left,
        -apart / time * x * left,
        -apart / time**2 * (1.0 - x) * left,
        apart / time**3 * (2.0 - x) * left,
    ]
