"""The experiment of the thesis (Appendix A) on a simulated wing, written as a dataset.

The cameras are stroboscopic: they take frames at slightly more than a multiple of the flap frequency, so that each
frame shows another phase of the beat. Some markers are missing throughout, others in some frames; the noise is coloured
by the tracker's Kalman filter. The instant at which the cameras are triggered is not part of the dataset, so the start
of the beat must be determined from the tracks.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wingfit.records import (
    Condition,
    Dataset,
    FourBarDrive,
    Genome,
    Hinge,
    Marker,
    Materials,
    Recording,
    Rod,
    Station,
    Wing,
)
from wingfit.records.array_types import Array, Float, Mask
from wingfit.records.blas_threads import one_blas_thread
from wingfit.records.dataset import Rig
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.virtual_rigs import save_with_truth
from wingfit.sim.wing.flexible_wing import FlexibleWing

# Settings for the true wing: far more accurate than in a calibration, periodic to 2 micrometres.
REFERENCE = Numerics(steps=480, max_beats=60, periodic=2e-6)
FRAMES_PER_BEAT = 30
LOST_MARKERS = 9
_MBAR, _ZERO_C = 100.0, 273.15
_LAGS = tuple(math.radians(d) for d in (0.0, 3.0, 7.0))
_FREQUENCIES = (2.0, 3.0, 4.0)
_SPEEDS = (1.0, 3.5, 6.0, 8.5, 11.0)
_TUNNEL_INCIDENCE = math.radians(4.0)

# Planform of a falcon wing 0.5 m long: y, leading edge, chord, thickness in m.
_STATIONS = (
    (0.03, 0.000, 0.200, 0.0140),
    (0.10, -0.005, 0.210, 0.0130),
    (0.18, -0.008, 0.205, 0.0120),
    (0.26, -0.004, 0.190, 0.0110),
    (0.34, 0.012, 0.165, 0.0100),
    (0.42, 0.045, 0.130, 0.0090),
    (0.48, 0.085, 0.090, 0.0080),
    (0.52, 0.120, 0.055, 0.0070),
)


@dataclass(frozen=True)
class Tracking:
    """Quality of the recorded tracks.

    Attributes:
        noise: standard deviation along x, y, z, m (largest along z, the depth of the stereo cameras).
        memory: correlation of the noise from frame to frame.
        gap_rate: probability per frame that a gap of a marker starts.
        gap_frames: mean length of such a gap, frames.
        beats: number of apparent beats recorded, those that the stroboscopic frames seem to show.
    """

    noise: tuple[float, float, float] = (4e-4, 4e-4, 6e-4)
    memory: float = 0.6
    gap_rate: float = 0.006
    gap_frames: float = 5.0
    beats: int = 4


def vacuum(pressure_mbar: float, lag: float, frequency: float) -> Condition:
    """Condition in the vacuum chamber at 20 degrees C; ``lag`` of the rear rod in rad, ``frequency`` in Hz."""
    return Condition(frequency, lag, pressure_mbar * _MBAR, _ZERO_C + 20.0)


def tunnel(lag: float, frequency: float, airspeed: float) -> Condition:
    """Condition in the wind tunnel; ``lag`` of the rear rod in rad, ``frequency`` in Hz, ``airspeed`` in m/s."""
    return Condition(frequency, lag, 1013.25 * _MBAR, _ZERO_C + 20.0, airspeed, _TUNNEL_INCIDENCE)


VACUUM = tuple(vacuum(p, lag, f) for p in (1000.0, 100.0, 10.0) for lag in _LAGS for f in _FREQUENCIES)
WIND_TUNNEL = tuple(tunnel(lag, f, v) for lag in _LAGS for f in _FREQUENCIES for v in _SPEEDS)

# Conditions of the campaign of the thesis and of a small one, and whether each is held out.
FULL = tuple((condition, k % 4 == 3) for k, condition in enumerate((*VACUUM, *WIND_TUNNEL)))
# Those held out differ from the others in frequency, lag, pressure or speed.
SMALL = (
    (vacuum(10.0, _LAGS[0], 2.0), False),
    (vacuum(10.0, _LAGS[1], 3.0), False),
    (vacuum(10.0, _LAGS[2], 4.0), False),
    (vacuum(10.0, _LAGS[2], 3.0), True),
    (vacuum(100.0, _LAGS[1], 4.0), True),
    (tunnel(_LAGS[1], 2.0, 8.5), False),
    (tunnel(_LAGS[0], 3.0, 3.5), False),
    (tunnel(_LAGS[2], 4.0, 6.0), False),
    (tunnel(_LAGS[2], 3.0, 6.0), True),
    (tunnel(_LAGS[0], 4.0, 8.5), True),
)


def robird_wing() -> Wing:
    """Return a wing like that of the Robird, driven by a four-bar linkage, with 49 markers.

    The markers are closer to each other towards the tip and the trailing edge.
    """
    stations = tuple(Station(*row) for row in _STATIONS)
    y, le, chord, thickness = (np.array(column) for column in zip(*_STATIONS, strict=True))
    u = (np.arange(7) + 0.5) / 7
    span = y[0] + (y[-1] - y[0]) * (1 - (1 - u) ** 1.25)
    along = 1 - (1 - (0.03 + 0.94 * np.arange(7) / 6)) ** 1.3
    places = [
        (np.interp(b, y, le) + s * np.interp(b, y, chord), b, np.interp(b, y, thickness) / 2)
        for b in span
        for s in along
    ]
    rounded = [(round(float(x), 5), round(float(b), 5), round(float(z), 5)) for x, b, z in places]
    markers = tuple(Marker(f"m{k:02d}", place, 5e-5) for k, place in enumerate(rounded, 1))
    return Wing(
        name="robird",
        stations=stations,
        materials=Materials(foam_density=30.0, skin_areal_density=0.25),
        rods=(
            Rod("front", 0.035, 0.03, 0.075, 0.44, 0.004, 1600.0, 0.012),
            Rod("rear", 0.120, 0.03, 0.130, 0.36, 0.003, 1600.0, 0.010),
        ),
        driven_rods=("front", "rear"),
        markers=markers,
        reference_markers=tuple(markers[7 * i].name for i in range(7)),
        hinge=Hinge(0.0, 0.0),
        drive=FourBarDrive(ground=0.06, crank=0.0135, coupler=0.055, rocker=0.028, offset=-1.9),
    )


def true_genome(model: FlexibleWing, seed: int) -> Genome:
    """Draw a genome: each gene log-uniformly between 1 / 1.8 (0.55) and 1.8 times its estimate."""
    rng = np.random.default_rng([seed, 1])
    drawn = {gene.name: float(gene.nominal * 1.8 ** rng.uniform(-1.0, 1.0)) for gene in model.genes}
    return Genome.nominal(model.genes).replace(drawn)


def read_truth(path: Path) -> Genome:
    """Read the true genome from the file that :func:`write_campaign` wrote next to a dataset."""
    values: dict[str, float] = json.loads(path.read_text(encoding="utf-8"))["genome"]
    return Genome.nominal(FlexibleWing(robird_wing()).genes).replace(values)


def blank_recording(wing: Wing, condition: Condition, name: str = "blank", frames: int = 8) -> Recording:
    """Return a recording of all markers over one beat whose values are all missing (NaN).

    It describes what to simulate: the ``condition`` and the instants, ``frames`` equal steps.
    """
    times = np.arange(frames) / (frames * condition.flap_frequency)
    markers = tuple(m.name for m in wing.markers)
    rig: Rig = "wind_tunnel" if condition.airspeed > 0 else "vacuum_chamber"
    return Recording(name, rig, condition, times, markers, np.full((frames, 3 * len(markers)), np.nan))


def name_of(condition: Condition) -> str:
    """Name of the recording made under a condition, such as ``vac-0010mbar-lag3-3.0hz``."""
    lag, f = round(math.degrees(condition.phase_lag)), condition.flap_frequency
    if condition.airspeed > 0:
        return f"wt-{condition.airspeed:04.1f}ms-lag{lag}-{f:.1f}hz"
    return f"vac-{condition.pressure / _MBAR:04.0f}mbar-lag{lag}-{f:.1f}hz"


@one_blas_thread
def record(
    model: FlexibleWing, genome: Genome, condition: Condition, tracking: Tracking, rng: np.random.Generator
) -> Recording:
    """Simulate the wing of ``genome`` under ``condition`` and return its recorded tracks, with noise and gaps."""
    blank = blank_recording(model.wing, condition)
    beat = model.beat(genome.values, blank)
    if beat.reason:
        raise ValueError(f"the true wing fails under {name_of(condition)}: {beat.reason}")
    return film(model.wing, condition, beat.tracks, tracking, rng)


def film(
    wing: Wing, condition: Condition, beat: Float[Array, "n M 3"], tracking: Tracking, rng: np.random.Generator
) -> Recording:
    """Return the tracks that cameras record of a periodic motion, with noise and gaps.

    ``beat`` [n, M, 3] (m): positions of the M markers of ``wing`` at n equal steps of a beat.
    """
    frames = (FRAMES_PER_BEAT + 1) * tracking.beats
    strobe = condition.flap_frequency * (FRAMES_PER_BEAT + 1) / FRAMES_PER_BEAT
    times = np.arange(frames) / strobe
    trigger = rng.uniform(0.0, 1.0)
    tracks = _sample(beat, condition.flap_frequency * times + trigger)
    tracks = np.round(tracks + _noise(tracks.shape, tracking, rng), 5)
    tracks[_gaps(tracks.shape[:2], tracking, rng)] = np.nan
    names = [m.name for m in wing.markers]
    visible = np.sort(rng.permutation(len(names))[: len(names) - LOST_MARKERS])
    seen, values = tuple(names[k] for k in visible), tracks[:, visible].reshape(frames, -1)
    rig = blank_recording(wing, condition).rig
    return Recording(name_of(condition), rig, condition, np.round(times, 7), seen, values)


def _sample(tracks: Array, beats: Array) -> Array:
    """Evaluate periodic ``tracks`` [n, M, 3], n equal steps of a beat, at the times ``beats`` [T]; returns [T, M, 3].

    The full Fourier series of the tracks is used.
    """
    n = len(tracks)
    series = np.fft.rfft(tracks, axis=0) / n
    series[1:] *= 2
    turn = np.exp(2j * np.pi * np.arange(len(series)) * beats[:, None])
    return np.asarray(np.einsum("tk,kmi->tmi", turn, series).real)


def _noise(shape: tuple[int, ...], tracking: Tracking, rng: np.random.Generator) -> Array:
    """Noise [T, M, 3] (m), first-order autoregressive from frame to frame, larger for some markers than for others."""
    white = rng.standard_normal(shape)
    noise: Array = np.empty(shape)
    noise[0] = white[0]
    for t in range(1, shape[0]):
        noise[t] = tracking.memory * noise[t - 1] + math.sqrt(1 - tracking.memory**2) * white[t]
    per_marker = np.exp(0.2 * rng.standard_normal((1, shape[1], 1)))
    return np.asarray(noise * per_marker * np.array(tracking.noise))


def _gaps(shape: tuple[int, ...], tracking: Tracking, rng: np.random.Generator) -> Mask:
    """True [T, M] where a marker is not recorded: gaps whose lengths have a geometric distribution."""
    lost = np.zeros(shape, bool)
    for t, m in zip(*np.nonzero(rng.uniform(size=shape) < tracking.gap_rate), strict=True):
        lost[t : t + rng.geometric(1 / tracking.gap_frames), m] = True
    return lost


def campaign(
    *,
    division: str = "24",
    small: bool = False,
    seed: int = 1,
    tracking: Tracking | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[Dataset, Genome]:
    """Simulate a campaign; return the dataset and the true genome.

    ``division``: discretisation of the true wing. ``small``: ten recordings; otherwise the 72 of the thesis.
    ``progress`` is called after each recording with the completed fraction.
    """
    model = FlexibleWing(robird_wing(), division, numerics=REFERENCE)
    truth = true_genome(model, seed)
    plan, recordings, held_out = SMALL if small else FULL, [], []
    for k, (condition, hidden) in enumerate(plan):
        rng = np.random.default_rng([seed, 2, k])
        recordings.append(record(model, truth, condition, tracking or Tracking(), rng))
        if hidden:
            held_out.append(recordings[-1].name)
        if progress:
            progress((k + 1) / len(plan))
    text = f"Virtual Robird campaign, {division} bodies, seed {seed}"
    return Dataset(f"robird-{division}", model.wing, tuple(recordings), tuple(held_out), text), truth


def write_campaign(
    path: Path,
    *,
    division: str = "24",
    small: bool = False,
    seed: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Simulate a campaign and write it to ``path`` (folder, .zip or .nc), the true genome next to it.

    Returns the path of the JSON file with the true genome. The other arguments are those of :func:`campaign`.
    """
    dataset, truth = campaign(division=division, small=small, seed=seed, progress=progress)
    return save_with_truth(dataset, {"division": division, "seed": seed, "genome": truth.as_dict()}, path)
