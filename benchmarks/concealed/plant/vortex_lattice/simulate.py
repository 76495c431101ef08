"""Unsteady vortex lattice simulation of a flapping pair of wings, by PteraSoftware, which produces test data.

Unlike a quasi-steady blade-element model, it has shed and trailing vortices with their downwash and lag, and the loss
of lift at the tips. It has no stall, leading-edge vortex or friction. PteraSoftware 5 (Urban, MIT licence) has
large dependencies, so it runs in a virtual environment of its own (:mod:`.worker`).
"""

from __future__ import annotations

import json
import os
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.law import Concealed, check_known
from benchmarks.concealed.plant.vehicle.laws import LAWS as BLADE_ELEMENT_LAWS
from benchmarks.concealed.plant.vehicle.laws_stream import flown
from benchmarks.concealed.plant.vehicle.simulate import Motion, density, motion_of
from wingfit.records import Condition, Vehicle

Array = npt.NDArray[np.float64]
Inertia = Literal["printed", "acceleration"]

EFFECTS = (
    "stroke_amplitude",
    "stroke_bias",
    "wing_pitch_zero",
    "wing_pitch_amplitude",
    "wing_pitch_phase",
    "airspeed_error",
    "body_pitch_error",
    "residual_air",
)
"""Effects that can be hidden: changes of the wings' motion and of the stream, but not of the aerodynamic law."""
LAWS = {name: BLADE_ELEMENT_LAWS[name] for name in EFFECTS}
"""Laws of EFFECTS, which are those of the blade-element plant."""
VARIABLE = "PTERASOFTWARE_PYTHON"
WORKER = Path(__file__).with_name("worker.py")
REMEDY = (
    "make a virtual environment (python -m venv NAME), run NAME/bin/pip install 'pterasoftware>=5.1,<6', and set the "
    f"environment variable {VARIABLE} to NAME/bin/python"
)
UNSETTLED = 0.02  # largest change of the force from the start of the last beat to its end, over its RMS
LONGEST = 900  # s, of one simulation


@dataclass(frozen=True)
class Resolution:
    """Resolution of the coarser of two lattices; the finer has twice the panels along the chord and twice the steps.

    The error of either is of first order, in proportion to panel and step, so that their forces extrapolate to
    F = 2 F_fine - F_coarse (Richardson 1911). For the flights of :mod:`.vehicle`, the RMS error of F is 1.5 % of the
    RMS force, that of F_fine 7 %.

    Attributes:
        span, chord: number of panels of one wing along span and chord; the former are narrower near the tip.
        steps: least and largest number of steps in a beat. Between them, the stream moves by a panel in a step, so that
            vortices in the wake are as long as those on the wing (Katz and Plotkin 2001, sect. 13.12).
        beats: number of beats; the last is returned.
        wake: length of the wake, beats.
        free: whether the wake moves with the velocity that vortices induce, or with the stream alone.
    """

    span: int = 8
    chord: int = 3
    steps: tuple[int, int] = (30, 80)
    beats: int = 2
    wake: float = 1.5
    free: bool = False


DEFAULT = Resolution()


def simulate(
    vehicle: Vehicle,
    condition: Condition,
    hidden: Concealed | None = None,
    *,
    instants: int = 120,
    inertia: Inertia = "printed",
    resolution: Resolution = DEFAULT,
) -> Array:
    """Forces [instants, 2] of all wings along body x and z (N) at equal steps of one beat from its start.

    The same arguments give the same forces.

    Args:
        vehicle: geometry, mass and prescribed motion of a pair of wings.
        condition: frequency, air, airspeed and body pitch.
        hidden: parameters of the hidden effects, by name as in LAWS.
        instants: number of instants in the beat.
        inertia: force of the wings' own mass, see :func:`wing_inertia`.
        resolution: of the lattice.

    Raises:
        ValueError: the vehicle has no pair of wings, there is no stream, or ``hidden`` has another effect.
        RuntimeError: PteraSoftware cannot be run or failed, or the forces do not settle.
    """
    hidden = hidden or {}
    coarse, fine = (
        resampled(forces_of(request_for(vehicle, condition, hidden, resolution, finer)), instants) for finer in (1, 2)
    )
    motion = motion_of(vehicle, condition.flap_frequency, instants, hidden)
    return np.asarray(2.0 * fine - coarse + wing_inertia(vehicle, flown(condition, hidden), motion, inertia))


def request_for(
    vehicle: Vehicle,
    condition: Condition,
    hidden: Concealed | None = None,
    resolution: Resolution = DEFAULT,
    finer: int = 1,
) -> dict[str, Any]:
    """Request to :mod:`.worker` with the motion of the wings in ``condition``; ValueError as :func:`simulate`.

    ``finer``: factor on the number of panels along the chord and of steps.
    """
    hidden = hidden or {}
    check_known(hidden, LAWS)
    if vehicle.layout != "pair" or vehicle.claps:
        raise ValueError(f"vehicle {vehicle.name!r} must have a pair of wings that do not clap")
    air = flown(condition, hidden)
    if not air.airspeed > 0.0:
        raise ValueError(f"the airspeed is {air.airspeed:g} m/s; the wake of a vortex lattice needs a stream")
    edges = vehicle.span * np.sin(0.5 * np.pi * np.arange(resolution.span + 1) / resolution.span)
    r, chord = [s.r for s in vehicle.stations], [s.chord for s in vehicle.stations]
    passed = air.airspeed / air.flap_frequency / (np.trapezoid(chord, r) / vehicle.span)
    steps = finer * int(np.clip(round(resolution.chord * passed), *resolution.steps))
    motion = motion_of(vehicle, air.flap_frequency, steps, hidden)
    root = vehicle.motion.root_pitch
    return {
        "r": edges.tolist(),
        "chord": np.interp(edges, r, chord).tolist(),
        "pitch_axis": vehicle.pitch_axis,
        "down": (motion.flap[0] - vehicle.dihedral).tolist(),
        "pitch": (root + (motion.pitch[0] - root) / vehicle.motion.pitch_station).tolist(),
        "root_pitch": root,
        "frequency": air.flap_frequency,
        "density": density(air),
        "airspeed": air.airspeed,
        "incidence": air.angle_of_attack,
        "panels": finer * resolution.chord,
        "beats": resolution.beats,
        "wake": resolution.wake,
        "free": resolution.free,
    }


def forces_of(request: dict[str, Any]) -> Array:
    """Forces [n, 2] (N) of :mod:`.worker`, run by the interpreter named in VARIABLE, at the n steps of ``request``.

    RuntimeError with a remedy if that interpreter or PteraSoftware is absent or fails, or the forces do not settle.
    """
    python = os.environ.get(VARIABLE, "")
    if not python:
        raise RuntimeError(f"the vortex lattice needs PteraSoftware: {REMEDY}")
    single = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    try:
        done = subprocess.run(  # noqa: S603
            [python, "-I", str(WORKER)],
            input=json.dumps(request),
            capture_output=True,
            text=True,
            check=False,
            timeout=LONGEST,
            env={**os.environ, **single},
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise RuntimeError(f"{VARIABLE} is {python!r}: {error}; {REMEDY}") from error
    if done.returncode:
        last = (done.stderr.strip() or "no message").splitlines()[-1]
        raise RuntimeError(f"the vortex lattice failed under {python!r}: {last}; if PteraSoftware is absent, {REMEDY}")
    reply = json.loads(done.stdout)
    if reply["settled"] > UNSETTLED:
        raise RuntimeError(
            f"the force at both ends of the last beat differs by {reply['settled']:.1%} of its RMS; simulate more beats"
        )
    return np.array(reply["forces"], float)


def resampled(values: Array, instants: int) -> Array:
    """One period of ``values`` [n, 2] at ``instants`` equal steps, by its Fourier series."""
    spectrum = np.fft.rfft(values, axis=0)
    return np.asarray(np.fft.irfft(spectrum, instants, axis=0) * (instants / len(values)))


def wing_inertia(vehicle: Vehicle, air: Condition, motion: Motion, inertia: Inertia = "printed") -> Array:
    """Force [n, 2] (N, body x and z) of the mass of both wings, on the axis of pitch and in proportion to chord.

    "printed": m theta' (v_z, -v_x) in axes of the chord, with the velocity v through the air, of Armanini et al.
    (2016), Eqs. 12-14; the nominal blade-element model has it, too. "acceleration": -m a, with the acceleration a of
    the mass (Newton 1687); a balance feels this force.

    Args:
        vehicle: mass, chord and dihedral of the wings.
        air: airspeed and body pitch.
        motion: flap and pitch angle with two time derivatives, at n instants.
        inertia: which of the two.
    """
    nodes, weights = np.polynomial.legendre.leggauss(40)
    r = 0.5 * vehicle.span * (nodes + 1.0)
    stations, chords = [s.r for s in vehicle.stations], [s.chord for s in vehicle.stations]
    chord = np.interp(r, stations, chords)
    mass = vehicle.wing_mass * chord * weights / (chord @ weights)
    zeta, rate, acceleration = motion.flap
    down = zeta - vehicle.dihedral
    if inertia == "acceleration":
        z = -2.0 * (mass @ r) * (np.cos(down) * acceleration - np.sin(down) * rate**2)
        return np.stack([np.zeros(len(z)), z], axis=1)
    share = r / (vehicle.motion.pitch_station * vehicle.span)
    theta = vehicle.motion.root_pitch + (motion.pitch[0] - vehicle.motion.root_pitch)[:, None] * share
    across = rate[:, None] * r + (air.airspeed * np.sin(air.angle_of_attack) * np.cos(down))[:, None]
    push = 2.0 * mass * motion.pitch[1][:, None] * share
    # v_x = U sin theta + w cos theta, v_z = U cos theta - w sin theta; turned back to body axes
    along = air.airspeed * np.cos(air.angle_of_attack)
    v_x, v_z = along * np.sin(theta) + across * np.cos(theta), along * np.cos(theta) - across * np.sin(theta)
    x = push * (v_z * np.sin(theta) - v_x * np.cos(theta))
    z = push * (v_z * np.cos(theta) + v_x * np.sin(theta))
    return np.stack([x.sum(axis=1), np.cos(down) * z.sum(axis=1)], axis=1)
