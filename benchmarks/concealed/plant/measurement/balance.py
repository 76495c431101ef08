"""Simulated force balance: turns the periodic forces of a vehicle into a recording.

It adds variation between wing beats, vibration of the mount, drift, sensor noise, and the faults of :data:`FAULTS`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.signal import butter, cont2discrete, lfilter, sosfiltfilt

from benchmarks.concealed.plant.law import Concealed, Law, Parameters, check_known, strength
from benchmarks.concealed.plant.measurement.noise import COLOURS, Colour, coloured
from wingfit.records import Condition, Recording, Vehicle
from wingfit.records.dataset import STANDARD_GRAVITY

Array = npt.NDArray[np.float64]

_FINER = 4  # oversampling before the final decimation
_LEAD = 6  # beats before and after the recording, for the filters' transients
_STAGES = 4  # low-pass stages of a delaying amplifier
_UNEQUAL = 0.9  # gain error of z relative to that of x
_DECIMALS = 5
_CUT = 0.4  # cut-off of the filter before the decimation, relative to the sampling rate
_UNITS = (1000.0 / STANDARD_GRAVITY, 1000.0, 1.0 / 4.4482216)  # gram-force, millinewtons and pounds in a newton


@dataclass(frozen=True)
class Weighing:
    """Settings of the balance: its noise, which does not repeat from one wing beat to the next, and its sampling.

    Attributes:
        colour: spectral colour of the sensor's noise, as in :data:`.noise.Colour`.
        memory: pole modulus of the sensor's noise (:func:`.noise.coloured`); lag-1 autocorrelation if first order.
        sensor: standard deviation of the sensor's noise, N.
        rattle: standard deviation of the mount's random vibration at its natural frequency, N.
        mount: natural frequencies of the mount along x and z, Hz.
        wander: standard deviation of a slow drift, N.
        scatter: standard deviation of the relative variation of the force between beats.
        jitter: standard deviation of the variation of the start of a beat, in beats.
        rate: samples per second.
        beats: number of beats in a recording.
    """

    colour: Colour
    memory: float
    sensor: float
    rattle: float
    mount: tuple[float, float]
    wander: float
    scatter: float
    jitter: float
    rate: float = 1250.0
    beats: int = 28


class Weighed(NamedTuple):
    """A recording by the balance.

    ``clean`` [T samples, 2]: the recorded forces without noise, N; ``noise``: RMS of the noise at all frequencies, N.
    """

    recording: Recording
    clean: Array
    noise: float


def draw_weighing(rng: np.random.Generator) -> Weighing:
    """Settings, drawn from ``rng``, of a balance similar to that of Armanini et al. (2016), section 3.2."""
    colours = [c for c in COLOURS if c != "shake"]
    low = [0.0, 8e-4, 4e-3, 105.0, 85.0, 2e-4, 0.008, 2e-4]
    high = [0.7, 2.5e-3, 1e-2, 150.0, 120.0, 6e-4, 0.025, 6e-4]
    memory, sensor, rattle, x, z, wander, scatter, jitter = (float(v) for v in rng.uniform(low, high))
    colour = colours[int(rng.integers(len(colours)))]
    return Weighing(colour, memory, sensor, rattle, (x, z), wander, scatter, jitter)


def silent(weighing: Weighing) -> Weighing:
    """Copy of the settings ``weighing`` without noise, drift and variation between beats."""
    return replace(weighing, sensor=0.0, rattle=0.0, wander=0.0, scatter=0.0, jitter=0.0)


def weigh(
    forces: Array,
    vehicle: Vehicle,
    condition: Condition,
    weighing: Weighing,
    rng: np.random.Generator,
    hidden: Concealed | None = None,
    *,
    name: str = "balance",
) -> Weighed:
    """Simulate a recording by the balance; the wing beat repeats exactly but for the noise of ``weighing``.

    ``forces`` [n, 2] along body x and z, N, at n equal steps of a beat from its start. ``hidden``: faults of the
    balance with their parameters, by name as in :data:`FAULTS`; the numbers drawn from ``rng`` do not depend on them.
    """
    hidden = hidden or {}
    check_known(hidden, FAULTS)
    noisy = _measured(forces, vehicle, condition, weighing, hidden, rng)
    clean = _measured(forces, vehicle, condition, silent(weighing), hidden, np.random.default_rng(0))
    times = np.round(np.arange(len(noisy)) / weighing.rate, 9)
    values = np.round(noisy, _DECIMALS)
    recording = Recording(name, "wind_tunnel", condition, times, (), values, forces=("x", "z"), mass=vehicle.mass)
    return Weighed(recording, clean, float(np.sqrt(np.mean((noisy - clean) ** 2))))


def _measured(
    forces: Array, vehicle: Vehicle, air: Condition, weighing: Weighing, hidden: Concealed, rng: np.random.Generator
) -> Array:
    """Output of the balance: forces [T, 2] in N along x and z, at the sampling rate ``weighing.rate``."""
    fine, frequency = weighing.rate * _FINER, air.flap_frequency
    kept = math.ceil(weighing.beats * weighing.rate / frequency)
    lead = round(_LEAD * weighing.rate / frequency) * _FINER
    t = (np.arange(kept * _FINER + 2 * lead) - lead) / fine
    at = _clock(t, hidden) * frequency
    size, start = (_by_beat(at, memory, rng) for memory in (0.3, 0.0))
    force = CubicSpline(np.arange(len(forces) + 1) / len(forces), np.concatenate([forces, forces[:1]]), 0, "periodic")
    start = weighing.jitter * start + _mark(hidden)
    felt = force((at + start) % 1.0) * (1.0 + weighing.scatter * size)[:, None]
    felt = _through(felt, fine, hidden)
    felt = felt + _noise(weighing, len(t), fine, rng)
    felt = sosfiltfilt(butter(8, 2.0 * _CUT / _FINER, output="sos"), felt, axis=0)
    seen = felt[lead : lead + kept * _FINER : _FINER]
    seen = seen + weighing.sensor * coloured(weighing.colour, weighing.memory, seen.shape, rng)
    return _shown(seen, np.arange(kept) / weighing.rate, vehicle, hidden)


def _clock(t: Array, hidden: Concealed) -> Array:
    """True times (s) of samples whose recorded times are ``t``: the clock may have an offset or a wrong rate."""
    return np.asarray(t * (1.0 + strength(hidden, "strobe_rate")) + strength(hidden, "clock_offset"))


def _mark(hidden: Concealed) -> float:
    """Phase (beats) at which the recorded time is zero: that of the sensor's mark on the mechanism."""
    return hidden["phase_reference"]["mark"] if strength(hidden, "phase_reference") else 0.0


def _by_beat(at: Array, memory: float, rng: np.random.Generator) -> Array:
    """Noise of unit variance at times ``at`` [T] (beats): one random value per beat, joined by a cubic spline.

    ``memory``: autocorrelation from one beat to the next.
    """
    first = math.floor(at[0]) - 3
    count = math.ceil(at[-1]) - first + 4
    values = coloured("first_order", memory, (count,), rng)
    return np.asarray(CubicSpline(first + 0.5 + np.arange(count), values)(at))


def _noise(weighing: Weighing, count: int, fine: float, rng: np.random.Generator) -> Array:
    """Noise [``count``, 2] in N along x and z: mount vibration plus slow drift, at ``fine`` samples per second."""
    out = np.empty((count, 2))
    for k, natural in enumerate(weighing.mount):
        b, a = _mount(natural, 0.02, fine)
        shaken = lfilter(b, a, rng.standard_normal(count))
        slow = np.cumsum(rng.standard_normal(count))
        slow -= np.linspace(slow[0], slow[-1], count)  # a Brownian bridge: it ends where it began
        out[:, k] = weighing.rattle * shaken / shaken.std() + weighing.wander * (slow - slow.mean()) / slow.std()
    return out


def _mount(natural: float, damping: float, rate: float) -> tuple[Array, Array]:
    """Numerator and denominator of the digital filter from the force on a mass to the force its mount transmits.

    With F the force per unit mass, w = 2 pi ``natural`` (Hz) and zeta = ``damping``, x'' + 2 zeta w x' + w^2 x = F; the
    output is w^2 x + 2 zeta w x' (Den Hartog 1956, transmissibility). F is constant between samples at ``rate`` (Hz).
    """
    w = 2.0 * math.pi * natural
    numerator, denominator = [2.0 * damping * w, w * w], [1.0, 2.0 * damping * w, w * w]
    b, a, _ = cont2discrete((numerator, denominator), 1.0 / rate, method="zoh")
    return np.asarray(b).ravel(), np.asarray(a).ravel()


def _through(forces: Array, rate: float, hidden: Concealed) -> Array:
    """Forces [T, 2] (N) after the faults of axes, mount and amplifier: cross-talk, resonance, delay, dry friction.

    ``rate``: samples of the input ``forces`` [T, 2] (N) per second.
    """
    if strength(hidden, "balance_tilt"):
        a = strength(hidden, "balance_tilt")
        forces = forces @ np.array([[1.0, a], [-a, 1.0]])  # cross-talk that the calibration matrix omits
    if strength(hidden, "balance_resonance"):
        p = hidden["balance_resonance"]
        b, a_ = _mount(p["frequency"], p["damping"], rate)
        swung = lfilter(b, a_, forces - forces[0], axis=0) + forces[0]
        forces = forces + p["strength"] * (swung - forces)
    if strength(hidden, "filter_delay"):
        held = strength(hidden, "filter_delay") * rate / _STAGES
        slow = held / (1.0 + held)  # an implicit step of 1 / (1 + tau s / 4), with exact delay
        for _ in range(_STAGES):  # four equal stages in series
            forces = lfilter([1.0 - slow], [1.0, -slow], forces - forces[0], axis=0) + forces[0]
    if strength(hidden, "dry_friction"):
        forces = _stuck(forces, hidden["dry_friction"])
    return forces


def _stuck(forces: Array, p: Parameters) -> Array:
    """Output [T, 2] (N) of a pivot with stiction: constant until a force differs from the output by ``strength`` (N).

    Play operator of Krejci (1996), on each axis.
    """
    reach, out = p["strength"], np.empty_like(forces)
    shown = forces[0]
    for t, force in enumerate(forces):
        shown = np.minimum(np.maximum(shown, force - reach), force + reach)
        out[t] = shown
    return out


def _shown(forces: Array, t: Array, vehicle: Vehicle, hidden: Concealed) -> Array:
    """Forces [T, 2] (N) at times ``t`` [T] (s) after the faults of the output.

    Gain, saturation, zero error, drift, and confusion of signs, axes or units.
    """
    gain = 1.0 + strength(hidden, "scale_error") * np.array([1.0, _UNEQUAL])
    forces = forces * gain
    if strength(hidden, "axis_scale"):
        p = hidden["axis_scale"]
        forces = forces * (1.0 + p["strength"] * _of_axis(p))
    if strength(hidden, "clipping"):
        part = strength(hidden, "clipping") * np.abs(forces) / (vehicle.mass * STANDARD_GRAVITY)
        forces = forces / (1.0 + part**4) ** 0.25
    if strength(hidden, "balance_offset"):
        forces = forces + hidden["balance_offset"]["strength"] * _way(hidden["balance_offset"])
    if strength(hidden, "balance_drift"):
        p = hidden["balance_drift"]
        forces = forces + p["strength"] * np.log1p(t / p["time"])[:, None] * _way(p)
    return _confused(np.asarray(forces), hidden)


def _confused(forces: Array, hidden: Concealed) -> Array:
    """Forces [T, 2] with the mistakes of whoever wrote them down: signs, axes, units. Any strength above zero is all.

    Components are in the order of the balance, whose channels may be exchanged.
    """
    if strength(hidden, "axis_sign"):
        forces = forces * _signs(hidden["axis_sign"])
    if strength(hidden, "axis_swap"):
        forces = forces[:, ::-1]
    if strength(hidden, "unit_error"):
        forces = forces * _unit(hidden["unit_error"])
    return np.asarray(forces)


def _of_axis(p: Parameters) -> Array:
    """One for the ``axis`` that is wrong and zero for the other, in the order x, z: 0 to 1 is x, 1 to 2 is z."""
    return np.array([1.0, 0.0] if p["axis"] < 1.0 else [0.0, 1.0])


def _signs(p: Parameters) -> Array:
    """Signs [2] of the forces along x and z, of which that of the ``axis`` is wrong."""
    return 1.0 - 2.0 * _of_axis(p)


def _unit(p: Parameters) -> float:
    """Recorded number per newton in the ``unit`` that the forces are in: a number from 0 to 3 chooses it."""
    return _UNITS[min(int(p["unit"]), len(_UNITS) - 1)]


def _sign_values(p: Parameters) -> dict[str, float]:
    x, z = _signs(p)
    return {"axis_sign.x": 0.5 * (1.0 - x), "axis_sign.z": 0.5 * (1.0 - z)}


def _way(p: Parameters) -> Array:
    return np.array([math.cos(p["azimuth"]), math.sin(p["azimuth"])])


_WAY = {"azimuth": (0.0, 2.0 * math.pi)}
_listed = partial(Law, side="measurement")
_unlisted = partial(Law, side="measurement", listed=False)
CHOICES = ("phase_reference", "axis_sign", "axis_swap", "unit_error")
"""Faults without a size: they are there at any strength above zero."""
FAULTS = {
    law.name: law
    for law in (
        _listed(
            "balance_tilt",
            typical=0.04,
            source="cross-talk of a linear calibration (AIAA R-091A 2020)",
            both_signs=True,
            values=lambda p: {"balance_tilt.angle": p["strength"]},
        ),
        _listed(
            "balance_resonance",
            typical=0.2,
            source="transmissibility of spring and damper, in time (Den Hartog 1956)",
            shape={"frequency": (45.0, 90.0), "damping": (0.02, 0.06)},
        ),
        _listed("filter_delay", typical=1.5e-3, source="four equal stages (Tietze, Schenk and Gamm 2008)"),
        _listed("balance_offset", typical=5e-3, source="zero error, N (AIAA R-091A 2020)", shape=_WAY),
        _listed(
            "balance_drift",
            typical=4e-3,
            source="creep of strain gauges, logarithmic in time (Doebelin 2004)",
            shape={"time": (0.1, 0.5)} | _WAY,
        ),
        _listed("scale_error", typical=0.05, source="gains of both axes, unequal (AIAA R-091A 2020)", both_signs=True),
        _listed(
            "axis_scale",
            typical=0.08,
            source="gain of a component (AIAA R-091A 2020)",
            both_signs=True,
            shape={"axis": (0.0, 2.0)},
            values=lambda p: dict(zip(("axis_scale.x", "axis_scale.z"), p["strength"] * _of_axis(p), strict=True)),
        ),
        _listed(
            "clock_offset",
            typical=8e-4,
            source="latency of a trigger",
            both_signs=True,
            values=lambda p: {"clock_offset.delay": p["strength"]},
        ),
        _listed(
            "strobe_rate",
            typical=4e-4,
            source="clock error",
            both_signs=True,
            values=lambda p: {"strobe_rate.part": p["strength"]},
        ),
        _listed(
            "phase_reference",
            typical=1.0,
            source="Armanini et al. (2016), sect. 3.2.2: a sensor's mark at another phase of the beat",
            shape={"mark": (0.15, 0.85)},
            values=lambda p: {"phase_reference.share": 1.0, "phase_reference.phase": p["mark"]},
        ),
        _listed(
            "axis_sign",
            typical=1.0,
            source="sign convention of the other body axes (AIAA R-091A 2020)",
            shape={"axis": (0.0, 2.0)},
            values=_sign_values,
        ),
        _listed(
            "axis_swap",
            typical=1.0,
            source="channels in another order (AIAA R-091A 2020)",
            values=lambda _: {"axis_swap.part": 1.0},
        ),
        _listed(
            "unit_error",
            typical=1.0,
            source="units beside the newton (BIPM 2019)",
            shape={"unit": (0.0, 3.0)},
            values=lambda p: {"unit_error.part": _unit(p) - 1.0},
        ),
        _unlisted("dry_friction", typical=0.02, source="play operator (Krejci 1996)"),
        _unlisted("clipping", typical=0.5, source="saturation of an amplifier, rounded"),
    )
}
