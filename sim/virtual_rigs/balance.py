"""A simulated wind-tunnel balance: force recordings of a DelFly-like vehicle whose coefficients are known.

Vehicle, conditions and coefficients are those of Armanini, Caetano, de Croon, de Visser and Mulder (2016), Tables 3-5
and 8. Their measured forces are not public; the recordings made here are predictions of their model, with the errors of
a real balance added.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy

from wingfit.records import (
    ChordStation,
    Condition,
    Dataset,
    PassivePitch,
    Recording,
    SplitCycleFlap,
    Vehicle,
    WingMotion,
)
from wingfit.records.array_types import Array
from wingfit.records.blas_threads import one_blas_thread
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.virtual_rigs import save_with_truth

AIR = (101_325.0, 293.15)  # Pa, K: assumed for the tunnel
DRAG = {"C_D0": 0.0, "C_Dpi2": 2.0}
"""Fixed drag coefficients: 0 at zero angle of attack (Table 6), and 2 at 90 degrees, the value of a flat plate, since
Table 6 is illegible there. It hardly affects X, to which the coefficients are fitted."""
LEAD_IN = 4  # beats before and after the recording, in which transients of the filters decay
ELEMENTS, INSTANTS = 80, 1600  # finer than in a calibration


@dataclass(frozen=True)
class Trial:
    """One test of Armanini et al. (2016): condition (Table 4), estimated coefficients (Table 8) and mass (kg).

    ``coefficients``: values of the genes C_l, C_r and C_F.
    """

    name: str
    condition: Condition
    coefficients: dict[str, float]
    mass: float


def _trial(number: int, row: Sequence[float]) -> Trial:
    speed, pitch, frequency, c_l, c_r, c_f = row
    condition = Condition(frequency, 0.0, *AIR, airspeed=speed, angle_of_attack=math.radians(pitch))
    mass = 17.4e-3 if speed < 1.0 else 18.4e-3
    return Trial(f"test-{number}", condition, {"C_l": c_l, "C_r": c_r, "C_F": c_f}, mass)


# V m/s, pitch deg, flap frequency Hz; C_l, C_r, C_F
_TABLES = (
    (0.30, 83, 13.3, 0.89, 1.49, 1.69),
    (0.50, 74, 12.5, 1.22, 1.45, 1.57),
    (0.55, 70, 12.5, 1.20, 1.45, 1.55),
    (0.65, 71, 12.5, 1.24, 1.44, 1.58),
    (0.70, 62, 11.7, 1.43, 1.39, 1.61),
    (0.80, 65, 13.3, 0.90, 1.39, 1.66),
    (1.00, 45, 11.7, 1.37, 1.41, 1.43),
    (2.00, 31, 10.3, 2.02, 1.57, 0.67),
)
TRIALS = tuple(_trial(k + 1, row) for k, row in enumerate(_TABLES))
HELD_OUT = ("test-3", "test-7")  # recordings of the example: an interpolation and an extrapolation


@dataclass(frozen=True)
class Balance:
    """How forces are recorded, and the errors of the balance. "The source" is Armanini et al. (2016).

    Attributes:
        rate: samples per second, Hz; as in the source (3.2.2).
        every: one sample of this many is stored, after an anti-aliasing filter; 1: all samples are stored.
        beats: whole beats in a recording; the source's tests lasted some tens.
        sensor: standard deviation of the white noise of a sample, N. The source's transducer resolves 0.149 gram-force.
        resonance: natural frequencies of the clamped body along x and along z, Hz: a body of 17 g on a strut, bent by a
        fuselage of carbon rod. They lie above the harmonics of interest; otherwise the balance could not measure these.
        damping: damping ratio of the resonance; clamped carbon structures have 1 to 3 %.
        participation: fraction of the force that excites the resonance. It is small, since the source clamps the body
            where
        the forces act, for this purpose (3.2.2). At 40 Hz it makes the forces 1 % too large: a systematic error.
        rattle: standard deviation, N, of the vibration that motor, gears and the tunnel's 1 % turbulence excite in the
        resonance.
        drift: standard deviation of the slow drift, N; small, since the zero is measured before each test.
        drift_time: correlation time of the drift, s; a transducer warms up in seconds to minutes.
        scatter: relative standard deviation of the force from beat to beat: in each beat the flow separates anew.
        timing: standard deviation of the instant at which a beat begins, beats: half a sample of 80 us. The phase comes
        from a Hall sensor on the mechanism, recorded with the forces (3.2.2) in every beat.
        memory: correlation of the scatter of one beat with that of the next.
        decimals: decimal places to which forces in N are rounded; the rounding is smaller than the noise.
    """

    rate: float = 12_500.0
    every: int = 1
    beats: int = 60
    sensor: float = 1.5e-3
    resonance: tuple[float, float] = (120.0, 95.0)
    damping: float = 0.02
    participation: float = 0.1
    rattle: float = 8e-3
    drift: float = 5e-4
    drift_time: float = 5.0
    scatter: float = 0.015
    timing: float = 0.0005
    memory: float = 0.3
    decimals: int = 5


EXAMPLE = Balance(every=10, beats=28, decimals=4)


def delfly() -> Vehicle:
    """Return the vehicle of Armanini et al. (2016, Table 3) with the wing motion of Table 5 and Eqs. 17, 20, 21.

    Root and tip chord are as printed; the chord at half span is chosen so that a pair of wings has the area of Table 3,
    2.11 dm^2. ``root_pitch`` is pi/2 (chord along the body): with the printed 0, the lift at 2 m/s is a third of the
    weight.
    """
    stations = (ChordStation(0.0, 0.085), ChordStation(0.0685, 0.0835), ChordStation(0.137, 0.056))
    flap = SplitCycleFlap(amplitude=0.34, bias=0.34, split=0.35)
    pitch = PassivePitch(0.3139, -1.1382, -0.0179, -0.0002)
    return Vehicle(
        name="delfly", layout="x4", claps=True, stations=stations, wing_mass=0.29e-3, thickness=1e-5,
        pitch_axis=0.0, dihedral=0.0, mass=17.4e-3, motion=WingMotion(flap, pitch, root_pitch=math.pi / 2),
    )  # fmt: skip


def blank_recording(condition: Condition, name: str = "blank", samples: int = 8) -> Recording:
    """Return a recording of forces along x and z over one beat whose values are all missing (NaN).

    It describes what to simulate: the ``condition`` and the instants, ``samples`` equal steps.
    """
    times = np.arange(samples) / (samples * condition.flap_frequency)
    values = np.full((samples, 2), np.nan)
    return Recording(name, "wind_tunnel", condition, times, (), values, forces=("x", "z"))


def true_beat(vehicle: Vehicle, trial: Trial) -> Array:
    """Simulate forces [n, 2] along body x and z (N) over one beat of ``trial``, with fine steps."""
    model = BladeElementWing(vehicle, elements=ELEMENTS, instants=INSTANTS)
    values = {gene.name: gene.nominal for gene in model.genes} | DRAG | trial.coefficients
    return np.asarray(model.beat([list(values.values())], blank_recording(trial.condition))[0])


@one_blas_thread
def record(beat: Array, trial: Trial, balance: Balance, rng: np.random.Generator) -> Recording:
    """Simulate a recording of the balance, errors included.

    ``beat`` [n, 2]: true forces along x and z (N) at n equal steps of one beat.
    """
    frequency = trial.condition.flap_frequency
    lead = round(LEAD_IN * balance.rate / frequency)
    samples = math.ceil(balance.beats * balance.rate / frequency)
    samples += -samples % balance.every
    at = np.asarray((np.arange(samples + 2 * lead) - lead) * frequency / balance.rate, np.float64)
    phase = at + balance.timing * _by_beat(at, 0.0, rng)
    grid = np.arange(len(beat)) / len(beat)
    forces = np.stack([np.interp(phase, grid, force, period=1.0) for force in beat.T], axis=1)
    forces = forces * (1.0 + balance.scatter * _by_beat(at, balance.memory, rng)[:, None])
    measured = np.stack([_measured(force, k, balance, rng) for k, force in enumerate(forces.T)], axis=1)
    kept = _decimation_filtered(measured, balance.every)[lead : lead + samples : balance.every]
    times = np.round(np.arange(len(kept)) * balance.every / balance.rate, 9)
    values = np.round(kept, balance.decimals)
    return Recording(trial.name, "wind_tunnel", trial.condition, times, (), values, forces=("x", "z"), mass=trial.mass)


def campaign(
    seed: int = 1, balance: Balance | None = None, trials: Sequence[Trial] = TRIALS, held_out: tuple[str, ...] = ()
) -> Dataset:
    """Record ``trials`` on the simulated balance; the same ``seed`` gives the same noise.

    ``balance``: its errors (None: the defaults of :class:`Balance`); ``held_out``: names of recordings to hold out.
    """
    vehicle = delfly()
    recordings = tuple(
        record(true_beat(vehicle, trial), trial, balance or Balance(), np.random.default_rng([seed, 3, k]))
        for k, trial in enumerate(trials)
    )
    text = f"Virtual balance, DelFly-like vehicle, seed {seed}: conditions and coefficients of Armanini et al. 2016"
    return Dataset("delfly", vehicle, recordings, held_out, text)


def write_campaign(path: Path, seed: int = 1, balance: Balance = EXAMPLE) -> Path:
    """Record all trials and write the dataset to ``path`` (folder, .zip or .nc), the true coefficients next to it.

    Returns the path of the JSON file with the true coefficients.
    """
    truth = {trial.name: DRAG | trial.coefficients for trial in TRIALS}
    dataset = campaign(seed, balance, held_out=HELD_OUT)
    return save_with_truth(dataset, {"seed": seed, "coefficients": truth}, path)


def read_truth(path: Path) -> dict[str, dict[str, float]]:
    """Read the true coefficients, by name of recording and gene, from the file that :func:`write_campaign` wrote."""
    truth: dict[str, dict[str, float]] = json.loads(path.read_text(encoding="utf-8"))["coefficients"]
    return truth


def _by_beat(at: Array, memory: float, rng: np.random.Generator) -> Array:
    """Random values [T] of unit variance, one a beat and linear in between, at the times ``at`` [T] in beats.

    The values at the beats' middles are first-order autoregressive noise; ``memory`` is the correlation of successive
    ones.
    """
    first = math.floor(at[0]) - 1
    beats = math.ceil(at[-1]) - first + 2
    white = rng.standard_normal(beats)
    values = scipy.signal.lfilter([math.sqrt(1 - memory**2)], [1.0, -memory], white)
    return np.asarray(np.interp(at, first + 0.5 + np.arange(beats), values))


def _measured(force: Array, axis: int, balance: Balance, rng: np.random.Generator) -> Array:
    """Force [T] (N) that the balance measures along ``axis`` (0: x, 1: z): ``force`` [T] plus all errors.

    The errors are the resonance, which the force and vibrations excite, slow drift, and white noise.
    """
    b, a = _resonator(balance.resonance[axis], balance.damping, balance.rate)
    spring_force = scipy.signal.lfilter(b, a, force - force[0]) + force[0]  # at rest under the first force
    rattle = scipy.signal.lfilter(b, a, rng.standard_normal(len(force)))
    rattle *= balance.rattle / max(float(rattle.std()), 1e-300)
    slow = math.exp(-1 / (balance.rate * balance.drift_time))
    start = [slow * rng.standard_normal()]  # stationary from the beginning
    drift, _ = scipy.signal.lfilter([math.sqrt(1 - slow**2)], [1.0, -slow], rng.standard_normal(len(force)), zi=start)
    white = balance.sensor * rng.standard_normal(len(force))
    return np.asarray(force + balance.participation * (spring_force - force) + rattle + balance.drift * drift + white)


def _resonator(frequency: float, damping: float, rate: float) -> tuple[Array, Array]:
    """Coefficients (b, a) of the digital filter from the force on a damped oscillator to the force in its spring.

    ``frequency``: natural frequency, Hz; ``damping``: damping ratio; ``rate``: samples per second.
    """
    omega = 2 * math.pi * frequency
    b, a = scipy.signal.bilinear([omega**2], [1.0, 2 * damping * omega, omega**2], fs=rate)
    return np.asarray(b), np.asarray(a)


def _decimation_filtered(forces: Array, every: int) -> Array:
    """Filter ``forces`` [T, C] against aliasing, without phase shift, before one of ``every`` samples is selected."""
    if every == 1:
        return forces
    return np.asarray(scipy.signal.sosfiltfilt(scipy.signal.butter(6, 0.8 / every, output="sos"), forces, axis=0))
