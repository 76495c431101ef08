"""A third rig: a driven torsional pendulum of one degree of freedom, unrelated to wings.

An arm turns about a horizontal axis, held level by a spring; a motor exerts a known torque. Markers along the arm are
recorded. At the angle theta

    (I + m r^2) theta'' + d theta' + k theta + k_3 theta^3 + tau tanh(theta' / v) + m g r cos theta = T(2 pi f t),

where k_3, tau and m are suspects. The periodic motion is computed by harmonic balance (Nayfeh and Mook 1979, Nonlinear
Oscillations, sect. 2.3.4), with forces at SAMPLES instants of the beat (Cameron and Griffin, Journal of Applied
Mechanics 56, 149, 1989).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wingfit.diagnosis.subject import ChannelLocation
from wingfit.records import Condition, Gene, Recording
from wingfit.rigs.suspect import Family, Suspect
from wingfit.sim.effects.probe import Probe
from wingfit.sim.model import Array, Model, Observation, genome_batch

REACH = 0.25  # m, from the axis to the end of the arm
MARKERS = {"inner": 0.10, "middle": 0.17, "outer": 0.24}  # m from the axis
TORQUE = (0.015,)  # N m: cosines of the motor's torque, from the first harmonic on
SLIDING = 0.3  # rad/s: friction is 3/4 of dry friction at this rate
HARMONICS, SAMPLES = 11, 128
STEPS, MAX_HALVINGS, TORQUE_TOLERANCE = 12, 6, 1e-11  # N m
CONTINUATION = ((1.0,), (0.1, 0.25, 0.5, 0.75, 1.0))  # fractions of the nonlinear torques: at once, or step by step
FRAMES, FRAMES_PER_BEAT = 124, 30  # strobed: each frame is of another beat
FREQUENCIES = (1.2, 1.7, 2.0, 2.7, 3.4)  # Hz; the nominal pendulum's own is 2.25 Hz

GENES = (
    Gene("stiffness", "N m/rad", 0.2, 0.06, 0.6, "log", "of the spring"),
    Gene("damping", "N m s/rad", 4e-3, 1e-3, 1.6e-2, "log", "torque that grows with the rate"),
    Gene("inertia", "kg m^2", 1e-3, 3e-4, 3e-3, "log", "of the arm about the axis"),
)


def _suspect(
    name: str, title: str, family: Family, genes: tuple[Gene, ...], typical: Mapping[str, float], texts: tuple[str, str]
) -> Suspect:
    station = f"{name}.station"
    has = any(gene.name == station for gene in genes)
    sizes = tuple(gene.name for gene in genes if gene.name != station)
    source, signature = texts
    return Suspect(name, title, family, genes, sizes, typical, source, signature, {"span": station} if has else {})


SUSPECTS = (
    _suspect(
        "cubic",
        "Spring that hardens",
        "structure",
        (Gene("cubic.k3", "N m/rad^3", 0.0, -0.4, 1.0, "linear", "torque by the cube of the angle"),),
        {"cubic.k3": 0.3},
        ("Duffing 1918, Erzwungene Schwingungen", "resonance moves with amplitude; third harmonic"),
    ),
    _suspect(
        "friction",
        "Dry friction",
        "structure",
        (Gene("friction.torque", "N m", 0.0, 0.0, 0.01, "linear", "torque against the motion, at any rate"),),
        {"friction.torque": 1e-3},
        ("Den Hartog 1931, Trans. ASME 53, APM-53-9", "small amplitudes are damped more than large ones"),
    ),
    _suspect(
        "point_mass",
        "Point mass on the arm",
        "inertia",
        (
            Gene("point_mass.mass", "kg", 0.0, 0.0, 0.03, "linear", "of the point"),
            Gene("point_mass.station", "1", 0.7, 0.0, 1.0, "linear", "its distance from the axis, part of the arm"),
        ),
        {"point_mass.mass": 5e-3, "point_mass.station": 0.7},
        ("Newton 1687", "the arm sags, and swings more slowly"),
    ),
    _suspect(
        "gain",
        "Sensor gain error",
        "measurement",
        (Gene("gain.part", "1", 0.0, -0.1, 0.1, "linear", "by which all positions are recorded too large"),),
        {"gain.part": 0.02},
        ("scale of an image", "every position grows by the same part"),
    ),
    _suspect(
        "delay",
        "Time delay",
        "measurement",
        (Gene("delay.time", "s", 0.0, -0.02, 0.02, "linear", "by which frames are older than recorded"),),
        {"delay.time": 3e-3},
        ("shift of time", "a lag that grows with frequency, equal in all markers"),
    ),
)


@dataclass(frozen=True)
class Pendulum:
    """The pendulum as a model with the suspects ``effects`` added; ``torque``: cosines of its motor's torque, N m."""

    effects: tuple[str, ...] = ()
    torque: tuple[float, ...] = TORQUE

    @property
    def genes(self) -> tuple[Gene, ...]:
        known = {suspect.name: suspect for suspect in SUSPECTS}
        return (*GENES, *(gene for name in self.effects for gene in known[name].genes))

    @property
    def searched(self) -> tuple[str, ...]:
        return tuple(gene.name for gene in self.genes)

    def observe(self, genomes: npt.ArrayLike, recording: Recording) -> Observation:
        """Positions [B, T, C] of the markers, x along the axis, y along the arm at rest, z up."""
        names = [gene.name for gene in self.genes]
        found = [self._seen(dict(zip(names, row, strict=True)), recording) for row in genome_batch(self.genes, genomes)]
        reasons = tuple(None if np.isfinite(one).all() else "no periodic motion was found" for one in found)
        return Observation(np.stack(found), reasons)

    def angle(self, values: Mapping[str, float], condition: Condition) -> Array:
        """Cosines [0, HARMONICS] and then sines [HARMONICS] of the angle, rad; NaN where no motion is found."""
        rate = 2 * np.pi * condition.flap_frequency
        own = _Law.of(values, condition.gravity)
        drive = np.zeros(2 * HARMONICS + 1)
        drive[1 : 1 + len(self.torque)] = self.torque
        order = np.concatenate([np.arange(HARMONICS + 1), np.arange(1, HARMONICS + 1)])
        dynamic = np.diag(own.stiffness - own.inertia * (rate * order) ** 2) + own.damping * rate * _SLOPE
        linear = np.asarray(np.linalg.solve(dynamic, drive), np.float64)
        if own.linear:
            return linear
        for parts in CONTINUATION:
            motion = linear
            for part in parts:
                motion = _harmonic_balance(own.weaker(part), rate, dynamic, drive, motion)
            if np.isfinite(motion).all():
                break
        return motion

    def _seen(self, values: Mapping[str, float], recording: Recording) -> Array:
        times = recording.times - values.get("delay.time", 0.0)
        wave = _waves(2 * np.pi * recording.condition.flap_frequency * times)
        theta = (wave * self.angle(values, recording.condition)).sum(axis=1)
        arm = np.stack([0.0 * theta, np.cos(theta), np.sin(theta)], axis=1)
        reach = np.array([MARKERS[name] for name in recording.markers]) * (1.0 + values.get("gain.part", 0.0))
        return np.asarray((arm[:, None, :] * reach[:, None]).reshape(len(times), -1))


@dataclass(frozen=True)
class _Law:
    """Linear and nonlinear torques against the motion."""

    inertia: float
    damping: float
    stiffness: float
    cubic: float
    friction: float
    weight: float

    @classmethod
    def of(cls, values: Mapping[str, float], gravity: float) -> _Law:
        mass, lever = values.get("point_mass.mass", 0.0), REACH * values.get("point_mass.station", 0.0)
        return cls(
            values["inertia"] + mass * lever**2,
            values["damping"],
            values["stiffness"],
            values.get("cubic.k3", 0.0),
            values.get("friction.torque", 0.0),
            mass * gravity * lever,
        )

    @property
    def linear(self) -> bool:
        return self.cubic == self.friction == self.weight == 0.0

    def weaker(self, part: float) -> _Law:
        """The same with the nonlinear torques multiplied by ``part``."""
        return replace(self, cubic=part * self.cubic, friction=part * self.friction, weight=part * self.weight)

    def torque(self, angle: Array, rate: Array) -> tuple[Array, Array, Array]:
        """The nonlinear part, N m, and its slopes with angle and rate."""
        pull = np.tanh(rate / SLIDING)
        return (
            self.cubic * angle**3 + self.friction * pull + self.weight * np.cos(angle),
            3 * self.cubic * angle**2 - self.weight * np.sin(angle),
            self.friction * (1 - pull**2) / SLIDING,
        )


def _waves(phase: Array) -> Array:
    """Basis functions [T, 2 HARMONICS + 1]: one, cosines, sines."""
    turn = phase[:, None] * np.arange(HARMONICS + 1)
    return np.concatenate([np.cos(turn), np.sin(turn[:, 1:])], axis=1)


def _slope() -> Array:
    """Matrix that turns a Fourier series into that of its derivative with the phase."""
    order, zero = np.arange(1, HARMONICS + 1), np.zeros((HARMONICS, HARMONICS))
    inner = np.block([[zero, np.diag(order)], [-np.diag(order), zero]])
    return np.pad(inner, ((1, 0), (1, 0)))


_SLOPE = _slope()
_BEAT = _waves(2 * np.pi * np.arange(SAMPLES) / SAMPLES)
_RATES = _BEAT @ _SLOPE
_BACK = _BEAT.T / (_BEAT**2).sum(axis=0)[:, None]


def _harmonic_balance(law: _Law, rate: float, dynamic: Array, drive: Array, motion: Array) -> Array:
    """Fourier series of the periodic motion, by Newton's method with shortened steps from ``motion``."""

    def residual(series: Array) -> tuple[Array, Array]:
        torque, by_angle, by_rate = law.torque(_BEAT @ series, rate * (_RATES @ series))
        slope = dynamic + _BACK @ (by_angle[:, None] * _BEAT + (rate * by_rate)[:, None] * _RATES)
        return dynamic @ series + _BACK @ torque - drive, slope

    now, slope = residual(motion)
    for _ in range(STEPS):
        size = np.linalg.norm(now)
        if size <= TORQUE_TOLERANCE:
            return motion
        if not np.isfinite(size):
            break
        step = np.linalg.solve(slope, now)
        for part in 0.5 ** np.arange(MAX_HALVINGS):
            then, other = residual(motion - part * step)
            if np.linalg.norm(then) < size:
                break
        motion, now, slope = motion - part * step, then, other
    return np.full(len(motion), np.nan)


@dataclass(frozen=True)
class PendulumRig:
    """The pendulum under diagnosis."""

    model: Pendulum = Pendulum()
    suspects: tuple[Suspect, ...] = SUSPECTS

    @property
    def outline(self) -> tuple[tuple[float, float], ...]:
        """The arm, a centimetre wide."""
        return ((-0.005, 0.0), (-0.005, REACH), (0.005, REACH), (0.005, 0.0), (-0.005, 0.0))

    @property
    def description(self) -> str:
        return "torsional pendulum of one degree of freedom"

    def extended(self, names: Sequence[str]) -> Pendulum:
        return replace(self.model, effects=(*self.model.effects, *names))

    def with_initial_motion(self, model: Model, genome: Array) -> Model:  # noqa: ARG002
        return model

    def finer_subjects(self) -> tuple[()]:
        """None: a pendulum is one body."""
        return ()

    def channel_locations(self, recording: Recording) -> tuple[ChannelLocation, ...]:
        return tuple(
            ChannelLocation(name, axis, MARKERS[name] / REACH, 0.5, 0.0, MARKERS[name])
            for name in recording.markers
            for axis in "xyz"
        )

    def beat_start_phase(self, recording: Recording) -> float:  # noqa: ARG002
        """Times count from the start of a beat."""
        return 0.0

    def simulated_recording(self, model: Model, genome: Array, condition: Condition) -> Recording | None:
        empty = blank(condition)
        seen = model.observe(genome[None], empty)
        return None if seen.reasons[0] else replace(empty, values=seen.channels[0])

    def probe_responses(self, genome: Array, recording: Recording, probe: Probe) -> None:
        """None: it has no span."""

    def candidate_conditions(self) -> tuple[Condition, ...]:
        """Conditions between the lowest and highest recorded frequency."""
        return tuple(at(float(f)) for f in np.linspace(FREQUENCIES[0], FREQUENCIES[-1], 12)[1:-1])


def at(frequency: float) -> Condition:
    """The condition with the motor at ``frequency`` (Hz)."""
    return Condition(frequency, 0.0, 101_325.0, 293.15)


def blank(condition: Condition, frames: int = FRAMES) -> Recording:
    """A recording without data."""
    times = np.arange(frames) * FRAMES_PER_BEAT / ((FRAMES_PER_BEAT + 1) * condition.flap_frequency)
    values = np.full((frames, 3 * len(MARKERS)), np.nan)
    name = f"pendulum-{condition.flap_frequency:g}hz"
    return Recording(name, "vacuum_chamber", condition, times, tuple(MARKERS), values)


def recorded(
    truth: Mapping[str, float],
    *,
    noise: float = 2e-4,
    lag1: float = 0.5,
    seed: int = 1,
    frequencies: Sequence[float] = FREQUENCIES,
    frames: int = FRAMES,
) -> tuple[Recording, ...]:
    """Recordings of a pendulum with coloured ``noise`` (m); genes that ``truth`` does not name are nominal.

    A suspect with a gene in ``truth`` is in the model; its other genes are typical.
    """
    named = [s for s in SUSPECTS if any(gene.name in truth for gene in s.genes)]
    model = Pendulum(tuple(s.name for s in named))
    typical = {name: value for s in named for name, value in s.typical.items()}
    values = {gene.name: gene.nominal for gene in GENES} | typical | dict(truth)
    genome = np.array([[values[gene.name] for gene in model.genes]])
    rng = np.random.default_rng(seed)
    found = []
    for frequency in frequencies:
        empty = blank(at(frequency), frames)
        error = rng.standard_normal(empty.values.shape)
        for k in range(1, len(error)):
            error[k] = lag1 * error[k - 1] + np.sqrt(1 - lag1**2) * error[k]
        found.append(replace(empty, values=model.observe(genome, empty).channels[0] + noise * error))
    return tuple(found)
