"""Mistakes in datasets of vehicles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from benchmarks.mistakes.kinds import Kind
from benchmarks.mistakes.wings import DEG, Change, Rng, condition, times
from wingfit.records import Dataset, FourierFlap, FourierPitch, Recording, Vehicle, WingMotion

Array = npt.NDArray[np.float64]


def forces(change: Callable[[Array, Recording, Rng], Array], *, first: bool = False) -> Change:
    """Change the forces [T, 2] of every recording, or only of the ``first``."""

    def make(dataset: Dataset, rng: Rng) -> Dataset:
        made = [
            replace(one, values=np.ascontiguousarray(change(one.values.copy(), one, rng)))
            if not first or k == 0
            else one
            for k, one in enumerate(dataset.recordings)
        ]
        return replace(dataset, recordings=tuple(made))

    return make


def vehicle(change: Callable[[Vehicle], Vehicle | None]) -> Change:
    """Change the description of the vehicle."""

    def make(dataset: Dataset, _: Rng) -> Dataset | None:
        changed = change(dataset.vehicle)
        return None if changed is None else replace(dataset, rig=changed)

    return make


def flap(change: Callable[[FourierFlap], FourierFlap]) -> Change:
    """Change a flap angle that is a Fourier series."""

    def changed(one: Vehicle) -> Vehicle | None:
        motion = one.motion
        return (
            replace(one, motion=replace(motion, flap=change(motion.flap)))
            if isinstance(motion.flap, FourierFlap)
            else None
        )

    return vehicle(changed)


def pitch(change: Callable[[FourierPitch], FourierPitch]) -> Change:
    """Change a wing pitch that is a Fourier series."""

    def changed(one: Vehicle) -> Vehicle | None:
        motion = one.motion
        return (
            replace(one, motion=replace(motion, pitch=change(motion.pitch)))
            if isinstance(motion.pitch, FourierPitch)
            else None
        )

    return vehicle(changed)


def moved(change: Callable[[WingMotion], WingMotion]) -> Change:
    """Change the motion of the wings."""
    return vehicle(lambda one: replace(one, motion=change(one.motion)))


def _waves(one: FourierFlap, factor: float, mean: float = 1.0) -> FourierFlap:
    return replace(
        one,
        mean=mean * one.mean,
        cosine=tuple(factor * x for x in one.cosine),
        sine=tuple(factor * x for x in one.sine),
    )


def _pitched(one: FourierPitch, factor: float, mean: float) -> FourierPitch:
    return replace(
        one, mean=mean, cosine=tuple(factor * x for x in one.cosine), sine=tuple(factor * x for x in one.sine)
    )


def _lost(values: Array, _: Recording, rng: Rng) -> Array:
    for start in rng.integers(0, len(values) - 12, 6):
        values[start : start + 8] = 0.0
    return values


def _late(beats: float) -> Change:
    return lambda dataset, _: replace(
        dataset,
        recordings=tuple(
            replace(one, times=one.times + beats / one.condition.flap_frequency) for one in dataset.recordings
        ),
    )


def _frequency(factor: float) -> Change:
    return condition(lambda c: replace(c, flap_frequency=factor * c.flap_frequency))


def _copied(dataset: Dataset, _: Rng) -> Dataset:
    first, second, *rest = dataset.recordings
    same = replace(second, times=first.times, values=first.values)
    same = replace(same, condition=replace(same.condition, flap_frequency=first.condition.flap_frequency))
    return replace(dataset, recordings=(first, same, *rest))


def _one(change: Change) -> Change:
    """Change the second recording only, which the others then show; a single one shows nothing."""

    def make(dataset: Dataset, rng: Rng) -> Dataset | None:
        if len(dataset.recordings) < 2:
            return None
        changed = change(dataset, rng)
        if changed is None:
            return None
        first, _, *rest = dataset.recordings
        return replace(dataset, recordings=(first, changed.recordings[1], *rest))

    return make


def _stopping(values: Array, _: Recording, rng: Rng) -> Array:
    third = len(values) // 3
    values[-third:] = 0.003 * rng.standard_normal((third, values.shape[1]))
    return values


def _stuck(values: Array, *_: object) -> Array:
    values[:, 1] = 0.0417
    return values


def _fast(one: Recording) -> bool:
    return one.condition.airspeed * 3.6 > 26


NEAR_HOVER = 0.35  # rad
KINDS = (
    Kind("sign of x", "vehicle", forces(lambda f, *_: f * np.array([-1.0, 1.0])), ("force axes",)),
    Kind("sign of z", "vehicle", forces(lambda f, *_: f * np.array([1.0, -1.0])), ("force axes",)),
    Kind("both signs: forces on the balance", "vehicle", forces(lambda f, *_: -f), ("force axes",)),
    Kind("x and z exchanged", "vehicle", forces(lambda f, *_: f[:, ::-1]), ("force axes",)),
    Kind(
        "x and z exchanged, z up", "vehicle", forces(lambda f, *_: f[:, ::-1] * np.array([-1.0, 1.0])), ("force axes",)
    ),
    Kind("gram-force", "vehicle", forces(lambda f, *_: f / 9.80665e-3), ("force unit", "gram-force")),
    Kind("millinewtons", "vehicle", forces(lambda f, *_: 1000 * f), ("force unit", "millinewtons")),
    Kind("pounds-force", "vehicle", forces(lambda f, *_: f / 4.4482216), ("force unit",)),
    Kind("kilograms", "vehicle", forces(lambda f, *_: f / 9.80665), ("force unit",)),
    Kind("time zero a quarter beat late", "vehicle", _late(0.25), ("force phase",)),
    Kind("time zero half a beat late", "vehicle", _late(0.5), ("force phase",)),
    Kind("time zero a quarter beat early", "vehicle", _late(-0.25), ("force phase",)),
    Kind("sign of x, one recording", "vehicle", _one(forces(lambda f, *_: f * np.array([-1.0, 1.0]))), ("force axes",)),
    Kind(
        "sign of z, one recording",
        "vehicle",
        _one(forces(lambda f, *_: f * np.array([1.0, -1.0]))),
        ("force axes", "body pitch"),
        False,
    ),
    Kind("x and z exchanged, one recording", "vehicle", _one(forces(lambda f, *_: f[:, ::-1])), ("force axes",)),
    Kind("gram-force, one recording", "vehicle", _one(forces(lambda f, *_: f / 9.80665e-3)), ("force unit",)),
    Kind("a quarter beat late, one recording", "vehicle", _one(_late(0.25)), ("force phase",)),
    Kind(
        "sign of the body pitch, one recording",
        "vehicle",
        _one(condition(lambda c: replace(c, angle_of_attack=-c.angle_of_attack))),
        ("body pitch", "force axes"),
        False,
    ),
    Kind("lost samples are zeros", "vehicle", forces(_lost), ("placeholders",)),
    Kind("frequency 5 % high", "vehicle", _frequency(1.05), ("frequency",)),
    Kind("frequency 3 % low", "vehicle", _frequency(0.97), ("frequency",)),
    Kind("frequency doubled", "vehicle", _frequency(2.0), ("frequency",)),
    Kind("frequency halved", "vehicle", _frequency(0.5), ("frequency",)),
    Kind("frequency in rad/s", "vehicle", _frequency(2 * np.pi), ("frequency",)),
    Kind("frequency in beats per minute", "vehicle", _frequency(60.0), ("frequency",)),
    Kind("times in milliseconds", "vehicle", times(lambda t: 1000.0 * t), ("time unit",)),
    Kind("times in minutes", "vehicle", times(lambda t: t / 60.0), ("time unit",)),
    Kind("flap angle in radians", "vehicle", flap(lambda x: _waves(x, 1 / DEG, 1 / DEG)), ("motion",)),
    Kind("flap angle peak to peak", "vehicle", flap(lambda x: _waves(x, 2.0)), ("motion",)),
    Kind("flap angle half", "vehicle", flap(lambda x: _waves(x, 0.5)), ("motion",)),
    Kind("sign of the wing pitch", "vehicle", pitch(lambda x: _pitched(x, -1.0, x.mean)), ("motion",)),
    Kind("wing pitch in radians", "vehicle", pitch(lambda x: _pitched(x, 1 / DEG, x.mean / DEG)), ("motion",)),
    Kind("wing pitch from the body", "vehicle", pitch(lambda x: _pitched(x, 1.0, x.mean - np.pi / 2)), ("motion",)),
    Kind("root pitch in radians", "vehicle", moved(lambda m: replace(m, root_pitch=m.root_pitch / DEG)), ("motion",)),
    Kind(
        "body pitch in radians",
        "vehicle",
        condition(lambda c: replace(c, angle_of_attack=c.angle_of_attack / DEG)),
        ("body pitch",),
    ),
    Kind(
        "body pitch from the vertical",
        "vehicle",
        condition(lambda c: replace(c, angle_of_attack=np.pi / 2 - c.angle_of_attack)),
        ("body pitch",),
    ),
    Kind(
        "sign of the body pitch",
        "vehicle",
        condition(lambda c: replace(c, angle_of_attack=-c.angle_of_attack)),
        ("body pitch", "weight"),
    ),
    Kind("pressure in kPa", "vehicle", condition(lambda c: replace(c, pressure=c.pressure / 10)), ("air pressure",)),
    Kind("pressure in bar", "vehicle", condition(lambda c: replace(c, pressure=c.pressure / 1000)), ("air pressure",)),
    Kind(
        "temperature in Fahrenheit",
        "vehicle",
        condition(lambda c: replace(c, temperature=273.15 + 68.0)),
        ("air temperature",),
    ),
    Kind(
        "mass in grams",
        "vehicle",
        lambda d, _: replace(
            d,
            rig=replace(d.vehicle, mass=1000 * d.vehicle.mass),
            recordings=tuple(replace(r, mass=None) for r in d.recordings),
        ),
        ("mass",),
    ),
    Kind(
        "masses of vehicle and wings in grams",
        "vehicle",
        lambda d, _: replace(
            d,
            rig=replace(d.vehicle, mass=1000 * d.vehicle.mass, wing_mass=1000 * d.vehicle.wing_mass),
            recordings=tuple(replace(r, mass=None) for r in d.recordings),
        ),
        ("mass",),
    ),
    Kind(
        "mass of a wing in grams",
        "vehicle",
        vehicle(lambda v: replace(v, wing_mass=1000 * v.wing_mass)),
        ("mass", "wings"),
    ),
    Kind(
        "thickness a thousand times",
        "vehicle",
        vehicle(lambda v: replace(v, thickness=1000 * v.thickness)),
        ("thickness",),
        False,
    ),
    Kind("a recording copied", "vehicle", _copied, ("duplicate",), False),
    Kind("wings stop in the last third", "vehicle", forces(_stopping, first=True), ("unsteady",), False),
    Kind("one axis constant", "vehicle", forces(_stuck), ("constant channel",), False),
)
