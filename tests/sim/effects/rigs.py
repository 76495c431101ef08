"""Rigs that effects are tried on, and a beat of a rigid wing that faults of a measurement are applied to by hand."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt

from wingfit.records import Genome, Recording, Vehicle, Wing
from wingfit.sim.effects.apply import apply
from wingfit.sim.effects.contract import Effect
from wingfit.sim.effects.ports.observation import Sampling
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.virtual_rigs.balance import TRIALS, delfly
from wingfit.sim.virtual_rigs.campaign import Tracking, blank_recording, record, robird_wing, tunnel, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing

Array = npt.NDArray[np.float64]
AnyModel = FlexibleWing | BladeElementWing

NUMERICS = Numerics(steps=80, periodic=1e-4, max_beats=16)
CONDITIONS = {"air": tunnel(0.05, 3.0, 6.0), "vacuum": vacuum(10.0, 0.05, 3.0)}
TRIAL = TRIALS[1]


@cache
def wing_model() -> FlexibleWing:
    """Four bodies at fixed numerics."""
    return FlexibleWing(robird_wing(), "4", numerics=NUMERICS)


@cache
def vehicle_model() -> BladeElementWing:
    """The DelFly, computed coarsely."""
    return BladeElementWing(delfly(), elements=12, instants=160)


def rig_of(model: AnyModel) -> Wing | Vehicle:
    return model.wing if isinstance(model, FlexibleWing) else model.vehicle


def bare(kind: str, effect: str = "") -> AnyModel:
    """The model without effects; of a vehicle without the term that the effect stands for."""
    if kind == "wing":
        return wing_model()
    model = vehicle_model()
    return replace(model, terms=tuple(term for term in model.terms if not effect or term != EFFECTS[effect].term))


@cache
def recordings(kind: str) -> dict[str, Recording]:
    """What the nominal wing was recorded as in air and in vacuum; a test of the vehicle, in air."""
    if kind == "vehicle":
        return {"air": force_recording()}
    nominal = Genome.nominal(wing_model().genes)
    return {
        where: record(wing_model(), nominal, condition, Tracking(beats=2), np.random.default_rng(7))
        for where, condition in CONDITIONS.items()
    }


def force_recording(beats: int = 3, per_beat: int = 60, axes: str = "xz") -> Recording:
    """Times of a recording of forces; without data."""
    times = np.arange(beats * per_beat) / (per_beat * TRIAL.condition.flap_frequency)
    forces = tuple("xz"[k] for k in range(2) if "xz"[k] in axes)
    values = np.full((len(times), len(forces)), np.nan)
    return Recording("blank", "wind_tunnel", TRIAL.condition, times, (), values, forces=forces)  # type: ignore[arg-type]


def seen(name: str, sampling: Sampling, **values: float) -> Sampling:
    """``sampling`` after the effect called ``name``, at ``values`` of its parameters and else at their nominal ones."""
    effect: Effect = EFFECTS[name]
    genes = effect.genes(sampling.rig, sampling.cameras)
    genome = Genome.nominal(genes).replace({f"{name}.{key}": value for key, value in values.items()})
    batch = np.repeat(np.array([genome.values]), len(sampling.beat), axis=0)
    after = replace(sampling, beat=sampling.beat.copy(), times=sampling.times.copy(), added=sampling.added.copy())
    apply([effect], genes, batch, after)
    return after


def phases(n: int = 96) -> Array:
    return np.asarray(2 * np.pi * np.arange(n) / n)


def flapped(angle: Array) -> Array:
    """Markers [n, M, 3] of the rigid wing turned by ``angle`` [n] (rad, up) about the hinge."""
    x, y, z = np.array([marker.position for marker in wing_model().wing.markers]).T
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return np.stack([np.broadcast_to(x, (len(angle), len(x))), c * y - s * z, s * y + c * z], axis=-1)


def rigid_tracks(amplitude: float = 0.5) -> Sampling:
    """One rigid wing flapping as amplitude sin(psi)."""
    recording = blank_recording(wing_model().wing, CONDITIONS["air"], frames=62)
    recording = replace(recording, times=np.arange(62) / (3.0 * 31 / 30))
    beat = flapped(amplitude * np.sin(phases()))[None]
    times = recording.times[None].copy()
    return Sampling(wing_model().wing, recording, beat, times, np.zeros((1, *recording.values.shape)))


def wave_forces(harmonic: int = 1, axes: str = "xz") -> Sampling:
    """Forces of a sine of one harmonic along x (0.1 N) and half of it along z, with a mean of 0.2 N along x."""
    recording = force_recording(axes=axes)
    wave = np.sin(harmonic * phases(160))
    beat = np.stack([0.2 + 0.1 * wave, 0.05 * wave], axis=-1)[None]
    return Sampling(
        vehicle_model().vehicle, recording, beat, recording.times[None].copy(), np.zeros((1, *recording.values.shape))
    )


def harmonic_of(values: Array, order: int) -> complex:
    """Complex amplitude a of a periodic signal [n]: its harmonic is Re(a exp(i order psi)); of order 0 the mean."""
    return complex(np.fft.rfft(values)[order] / len(values) * (2 if order else 1))
