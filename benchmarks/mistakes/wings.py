"""Mistakes in datasets of wings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from benchmarks.mistakes.kinds import Kind
from wingfit.records import Condition, Dataset, FourBarDrive, FourierDrive, Recording, Wing

Array = npt.NDArray[np.float64]
Rng = np.random.Generator
DEG = 180.0 / np.pi
Change = Callable[[Dataset, Rng], Dataset | None]


def tracks(change: Callable[[Array, Recording, Rng], Array | None], *, first: bool = False) -> Change:
    """Change the positions [T, M, 3] of every recording, or only of the ``first``."""

    def make(dataset: Dataset, rng: Rng) -> Dataset | None:
        made = []
        for number, one in enumerate(dataset.recordings):
            positions = change(one.positions.copy(), one, rng) if not first or number == 0 else one.positions
            if positions is None:
                return None
            made.append(replace(one, values=np.ascontiguousarray(positions.reshape(len(positions), -1))))
        return replace(dataset, recordings=tuple(made))

    return make


def times(change: Callable[[Array], Array]) -> Change:
    """Change the times of every recording."""
    return lambda dataset, _: replace(
        dataset, recordings=tuple(replace(one, times=change(one.times)) for one in dataset.recordings)
    )


def condition(change: Callable[[Condition], Condition], *, only: Callable[[Recording], bool] | None = None) -> Change:
    """Change the condition of every recording, or of those for which ``only`` is true; None if there are none."""

    def make(dataset: Dataset, _: Rng) -> Dataset | None:
        chosen = [only is None or only(one) for one in dataset.recordings]
        made = [
            replace(one, condition=change(one.condition)) if yes else one
            for one, yes in zip(dataset.recordings, chosen, strict=True)
        ]
        return replace(dataset, recordings=tuple(made)) if any(chosen) else None

    return make


def wing(change: Callable[[Wing], Wing | None]) -> Change:
    """Change the description of the wing."""

    def make(dataset: Dataset, _: Rng) -> Dataset | None:
        changed = change(dataset.wing)
        return None if changed is None else replace(dataset, rig=changed)

    return make


def axes(order: tuple[int, int, int], signs: tuple[int, int, int]) -> Change:
    """Write the columns in another frame: column k holds axis ``order[k]`` of the wing with the sign ``signs[k]``."""
    return tracks(lambda p, *_: p[..., list(order)] * np.array(signs, float))


def rotated(degrees: float, axis: str) -> Change:
    """Rotate the frame about ``axis``."""
    turn = Rotation.from_euler(axis, degrees, degrees=True).as_matrix()
    return tracks(lambda p, *_: p @ turn.T)


def drive(fourier: Callable[[FourierDrive], FourierDrive]) -> Change:
    """Change a Fourier drive; None for a linkage."""
    return wing(lambda w: replace(w, drive=fourier(w.drive)) if isinstance(w.drive, FourierDrive) else None)


def scaled(mean: float, waves: float) -> Change:
    """Multiply mean and harmonics of a Fourier drive."""
    return drive(
        lambda d: replace(
            d, mean=mean * d.mean, cosine=tuple(waves * x for x in d.cosine), sine=tuple(waves * x for x in d.sine)
        )
    )


def linkage(change: Callable[[FourBarDrive], FourBarDrive]) -> Change:
    """Change a four-bar linkage; None for a Fourier drive."""
    return wing(lambda w: replace(w, drive=change(w.drive)) if isinstance(w.drive, FourBarDrive) else None)


def _filled(value: float) -> Callable[[Array, Recording, Rng], Array | None]:
    def change(positions: Array, _: Recording, rng: Rng) -> Array:
        gaps = ~np.isfinite(positions).all(axis=-1)
        extra = rng.uniform(size=gaps.shape) < 0.01
        positions[gaps | extra] = value
        return positions

    return change


def _frozen(whole: bool) -> Callable[[Array, Recording, Rng], Array | None]:
    def change(positions: Array, _: Recording, rng: Rng) -> Array:
        frames, markers = positions.shape[:2]
        marker = markers - 1 - int(rng.integers(markers // 3))
        start, end = (0, frames) if whole else (frames // 4, frames // 4 + max(12, frames // 5))
        known = np.flatnonzero(np.isfinite(positions[:, marker]).all(axis=1))
        positions[start:end, marker] = positions[known[known >= start][0], marker]
        return positions

    return change


def _pair(one: Recording, dataset_wing: Wing) -> tuple[int, int]:
    rest = np.array([dataset_wing.marker(name).position for name in one.markers])
    first = len(rest) // 2
    return first, int(np.argsort(np.linalg.norm(rest - rest[first], axis=1))[1])


def _swapped(dataset: Dataset, _: Rng) -> Dataset:
    made = []
    for one in dataset.recordings:
        a, b = _pair(one, dataset.wing)
        positions = one.positions.copy()
        positions[:, [a, b]] = positions[:, [b, a]]
        made.append(replace(one, values=positions.reshape(one.values.shape)))
    return replace(dataset, recordings=tuple(made))


def _rolled(positions: Array, *_: object) -> Array:
    return np.roll(positions, 1, axis=1)


def _jumping(positions: Array, one: Recording, rng: Rng) -> Array:
    for frame in rng.integers(1, len(positions) - 1, 3):
        positions[frame, len(one.markers) // 2] += np.array([0.0, 0.0, 0.4 * np.nanmax(np.abs(positions))])
    return positions


def _resting(positions: Array, *_: object) -> Array:
    """The rig runs up only after the first third."""
    frames = len(positions)
    with np.errstate(all="ignore"):
        mean = np.nanmean(positions, axis=0)
    quiet = frames // 3
    positions[:quiet] = mean + 0.02 * (positions[:quiet] - mean)
    return positions


def _duplicate(dataset: Dataset, _: Rng) -> Dataset:
    first, second, *rest = dataset.recordings
    same = replace(second, times=first.times, values=first.values, markers=first.markers)
    same = replace(same, condition=replace(same.condition, flap_frequency=first.condition.flap_frequency))
    return replace(dataset, recordings=(first, same, *rest))


def _cut(dataset: Dataset, _: Rng) -> Dataset | None:
    first, *rest = dataset.recordings
    inside = first.times * first.condition.flap_frequency < 0.6
    if inside.sum() < 8:
        return None
    return replace(dataset, recordings=(replace(first, times=first.times[inside], values=first.values[inside]), *rest))


def _constant(positions: Array, one: Recording, _: Rng) -> Array:
    positions[:, len(one.markers) // 2, 2] = 0.0123
    return positions


def _frequency(factor: float) -> Change:
    return condition(lambda c: replace(c, flap_frequency=factor * c.flap_frequency))


def _streaming(one: Recording) -> bool:
    return one.condition.airspeed > 0


def _lags(change: Callable[[float], float]) -> Change:
    def make(dataset: Dataset, rng: Rng) -> Dataset | None:
        if len({one.condition.phase_lag for one in dataset.recordings}) < 3:
            return None
        return condition(lambda c: replace(c, phase_lag=change(c.phase_lag)))(dataset, rng)

    return make


def _rods(density: float) -> Change:
    return wing(lambda w: replace(w, rods=tuple(replace(rod, density=density * rod.density) for rod in w.rods)))


def _foam(factor: float) -> Change:
    return wing(lambda w: replace(w, materials=replace(w.materials, foam_density=factor * w.materials.foam_density)))


def _masses(factor: float) -> Change:
    return wing(lambda w: replace(w, markers=tuple(replace(m, mass=factor * m.mass) for m in w.markers)))


def _thick(w: Wing) -> Wing:
    return replace(w, stations=tuple(replace(s, thickness=10 * s.thickness) for s in w.stations))


SHAPE, UP = ("axes", "side"), ("vertical sign", "axes", "side")
KINDS = (
    Kind("left wing: y negative", "wing", axes((0, 1, 2), (1, -1, 1)), ("side",)),
    Kind("x forward", "wing", axes((0, 1, 2), (-1, 1, 1)), SHAPE),
    Kind("z down", "wing", axes((0, 1, 2), (1, 1, -1)), UP),
    Kind("x forward, z down", "wing", axes((0, 1, 2), (-1, 1, -1)), UP),
    Kind("x forward, y inboard", "wing", axes((0, 1, 2), (-1, -1, 1)), SHAPE),
    Kind("left wing, z down", "wing", axes((0, 1, 2), (1, -1, -1)), UP),
    Kind("x and y exchanged", "wing", axes((1, 0, 2), (1, 1, 1)), SHAPE),
    Kind("y and z exchanged (y up)", "wing", axes((0, 2, 1), (1, 1, 1)), SHAPE),
    Kind("x and z exchanged", "wing", axes((2, 1, 0), (1, 1, 1)), SHAPE),
    Kind("axes turned in a ring", "wing", axes((1, 2, 0), (1, 1, 1)), SHAPE),
    Kind("y up, z aft of motion capture", "wing", axes((1, 2, 0), (1, 1, -1)), SHAPE),
    Kind(
        "one recording of a left wing",
        "wing",
        tracks(lambda p, *_: p * np.array([1.0, -1.0, 1.0]), first=True),
        ("side",),
    ),
    Kind("millimetres", "wing", tracks(lambda p, *_: 1000 * p), ("length unit",)),
    Kind("centimetres", "wing", tracks(lambda p, *_: 100 * p), ("length unit",)),
    Kind("inches", "wing", tracks(lambda p, *_: p / 0.0254), ("length unit",)),
    Kind("feet", "wing", tracks(lambda p, *_: p / 0.3048), ("length unit",)),
    Kind("positions scaled by 1.6", "wing", tracks(lambda p, *_: 1.6 * p), ("scale",), False),
    Kind(
        "origin at half span",
        "wing",
        tracks(lambda p, *_: p - np.array([0.0, 0.5 * np.nanmax(p[..., 1]), 0.0])),
        ("origin",),
        False,
    ),
    Kind(
        "origin 0.3 spans aft",
        "wing",
        tracks(lambda p, *_: p - np.array([0.3 * np.nanmax(p[..., 1]), 0.0, 0.0])),
        ("origin",),
        False,
    ),
    Kind(
        "origin above",
        "wing",
        tracks(lambda p, *_: p - np.array([0.0, 0.0, 0.4 * np.nanmax(p[..., 1])])),
        ("origin",),
        False,
    ),
    Kind("frame rotated by 30 degrees about z", "wing", rotated(30.0, "z"), ("tilt",), False),
    Kind("frame rotated by 30 degrees about y", "wing", rotated(30.0, "y"), ("tilt",), False),
    Kind("gaps filled with zeros", "wing", tracks(_filled(0.0)), ("placeholders",)),
    Kind("gaps filled with -1", "wing", tracks(_filled(-1.0)), ("placeholders",)),
    Kind("gaps filled with 9999", "wing", tracks(_filled(9999.0)), ("placeholders",)),
    Kind("marker held for a fifth of the frames", "wing", tracks(_frozen(whole=False)), ("frozen marker",)),
    Kind("marker held throughout", "wing", tracks(_frozen(whole=True)), ("frozen marker", "constant channel")),
    Kind("two neighbours exchanged", "wing", _swapped, ("swapped markers",)),
    Kind("names shifted by one", "wing", tracks(_rolled), ("swapped markers",)),
    Kind("jumps", "wing", tracks(_jumping, first=True), ("jumps",), False),
    Kind("frequency 5 % high", "wing", _frequency(1.05), ("frequency",), False),
    Kind("frequency 5 % low", "wing", _frequency(0.95), ("frequency",), False),
    Kind("frequency doubled", "wing", _frequency(2.0), ("frequency",), False),
    Kind("frequency halved", "wing", _frequency(0.5), ("frequency",), False),
    Kind("frequency in rad/s", "wing", _frequency(2 * np.pi), ("frequency",), False),
    Kind("frequency in beats per minute", "wing", _frequency(60.0), ("frequency",), False),
    Kind("times in milliseconds", "wing", times(lambda t: 1000.0 * t), ("time unit",)),
    Kind("times in minutes", "wing", times(lambda t: t / 60.0), ("time unit",)),
    Kind(
        "times are frame numbers",
        "wing",
        times(lambda t: np.arange(len(t), dtype=float)),
        ("time unit", "frequency"),
        False,
    ),
    Kind("drive in radians", "wing", scaled(1 / DEG, 1 / DEG), ("amplitude",)),
    Kind("drive peak to peak", "wing", scaled(1.0, 2.0), ("amplitude",)),
    Kind("drive half amplitude", "wing", scaled(1.0, 0.5), ("amplitude",)),
    Kind(
        "offset of the linkage in radians",
        "wing",
        linkage(lambda d: replace(d, offset=d.offset / DEG)),
        ("mean angle",),
    ),
    Kind("sign of the linkage's offset", "wing", linkage(lambda d: replace(d, offset=-d.offset)), ("mean angle",)),
    Kind("drive upside down", "wing", scaled(-1.0, -1.0), ("vertical sign",), False),
    Kind("phase lag in radians", "wing", _lags(lambda x: x / DEG), ("phase lag",)),
    Kind("sign of the phase lag", "wing", _lags(lambda x: -x), ("phase lag",)),
    Kind(
        "pressure in kPa",
        "wing",
        condition(lambda c: replace(c, pressure=c.pressure / 10), only=_streaming),
        ("air pressure",),
    ),
    Kind(
        "pressure in bar",
        "wing",
        condition(lambda c: replace(c, pressure=c.pressure / 1000), only=_streaming),
        ("air pressure",),
    ),
    Kind(
        "pressure in mmHg",
        "wing",
        condition(lambda c: replace(c, pressure=c.pressure / 1.333224), only=_streaming),
        ("air pressure",),
    ),
    Kind(
        "temperature in Fahrenheit",
        "wing",
        condition(lambda c: replace(c, temperature=273.15 + 1.8 * (c.temperature - 273.15) + 32)),
        ("air temperature",),
    ),
    Kind(
        "airspeed in km/h",
        "wing",
        condition(lambda c: replace(c, airspeed=3.6 * c.airspeed), only=lambda r: r.condition.airspeed > 7),
        ("airspeed",),
    ),
    Kind("rods in g/cm^3", "wing", _rods(1e-3), ("density",)),
    Kind("foam in g/cm^3", "wing", _foam(1e-3), ("density",)),
    Kind("masses of markers in grams", "wing", _masses(1e3), ("mass", "kilograms")),
    Kind("thickness ten times", "wing", wing(_thick), ("thickness",)),
    Kind(
        "a stream in the vacuum chamber",
        "wing",
        lambda d, _: (
            replace(d, recordings=tuple(replace(r, rig="vacuum_chamber") for r in d.recordings))
            if any(map(_streaming, d.recordings))
            else None
        ),
        ("pressure and rig",),
        False,
    ),
    Kind("a recording copied", "wing", _duplicate, ("duplicate",), False),
    Kind("part of a beat", "wing", _cut, ("cut",), False),
    Kind("rig at rest for a third", "wing", tracks(_resting, first=True), ("unsteady",), False),
    Kind("one column constant", "wing", tracks(_constant), ("constant channel",), False),
)
