"""Hypotheses of a wrong description of a vehicle's motion or condition, and what undoes each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from wingfit.checks.mistake import Edit, KeyEdit, Kind
from wingfit.records import Condition, Dataset, Flap, FourierFlap, FourierPitch, Recording, WingMotion
from wingfit.records.array_types import Array
from wingfit.records.description.convert import describe_rig

RADIANS = 180.0 / np.pi


@dataclass(frozen=True)
class Hypothesis:
    """A mistake in the description: ``change`` returns the dataset without it (None: it does not apply)."""

    kind: Kind
    cause: str
    change: Callable[[Dataset], Dataset | None]

    def edits(self, dataset: Dataset) -> tuple[Edit, ...]:
        """Return the values of ``dataset.yaml`` that the change alters."""
        changed = self.change(dataset)
        if changed is None:
            return ()
        rig = _differences(("vehicle",), describe_rig(dataset.rig), describe_rig(changed.rig))
        conditions = [
            KeyEdit(("recordings", index, key), f"{before:.6g}", f"{after:.6g}")
            for index, (old, new) in enumerate(zip(dataset.recordings, changed.recordings, strict=True))
            for key, before, after in _of_condition(old.condition, new.condition)
            if before != after
        ]
        return (*rig, *conditions)


class _Value(NamedTuple):
    key: str
    old: float
    new: float


def _of_condition(old: Condition, new: Condition) -> list[_Value]:
    return [
        _Value("airspeed_m_s", old.airspeed, new.airspeed),
        _Value("body_pitch_deg", float(np.degrees(old.angle_of_attack)), float(np.degrees(new.angle_of_attack))),
        _Value("pressure_mbar", old.pressure / 100.0, new.pressure / 100.0),
    ]


def _differences(path: tuple[str | int, ...], old: object, new: object) -> list[Edit]:
    """Edits of the numbers in which the plain data ``old`` and ``new`` differ."""
    if isinstance(old, dict) and isinstance(new, dict):
        return [edit for key in old if key in new for edit in _differences((*path, key), old[key], new[key])]
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        return [edit for k, (a, b) in enumerate(zip(old, new, strict=True)) for edit in _differences((*path, k), a, b)]
    if old != new:
        return [KeyEdit(path, f"{float(str(old)):.6g}", f"{float(str(new)):.6g}")]
    return []


def _air(change: Callable[[Condition], Condition | None]) -> Callable[[Dataset], Dataset | None]:
    def changed(dataset: Dataset) -> Dataset | None:
        recordings = list[Recording]()
        for one in dataset.recordings:
            condition = change(one.condition)
            if condition is None:
                return None
            recordings.append(replace(one, condition=condition))
        return replace(dataset, recordings=tuple(recordings))

    return changed


def _moving(change: Callable[[WingMotion], WingMotion | None]) -> Callable[[Dataset], Dataset | None]:
    def changed(dataset: Dataset) -> Dataset | None:
        motion = change(dataset.vehicle.motion)
        if motion is None or any(one.motion is not None for one in dataset.recordings):
            return None
        return replace(dataset, rig=replace(dataset.vehicle, motion=motion))

    return changed


def _flap(factor: float, *, mean: bool) -> Callable[[WingMotion], WingMotion | None]:
    def change(motion: WingMotion) -> WingMotion | None:
        scaled: Flap
        flap, middle = motion.flap, factor if mean else 1.0
        if isinstance(flap, FourierFlap):
            scaled = replace(
                flap, mean=middle * flap.mean, cosine=tuple(factor * x for x in flap.cosine),
                sine=tuple(factor * x for x in flap.sine),
            )  # fmt: skip
            size = abs(factor) * float(np.hypot(flap.cosine[0], flap.sine[0] if flap.sine else 0.0))
        else:
            # The whole range, if it was taken for the amplitude, is also that of the bias of wings that close.
            scaled = replace(flap, amplitude=factor * flap.amplitude, bias=factor * flap.bias)
            size = factor * flap.amplitude
        return replace(motion, flap=scaled) if 0.01 < size < np.pi / 2 else None

    return change


def _pitch(change: Callable[[FourierPitch], FourierPitch]) -> Callable[[WingMotion], WingMotion | None]:
    def changed(motion: WingMotion) -> WingMotion | None:
        return replace(motion, pitch=change(motion.pitch)) if isinstance(motion.pitch, FourierPitch) else None

    return changed


def _waves(pitch: FourierPitch, factor: float, mean: float) -> FourierPitch:
    cosine, sine = (tuple(factor * x for x in these) for these in (pitch.cosine, pitch.sine))
    return replace(pitch, mean=mean, cosine=cosine, sine=sine)


def _root(change: Callable[[float], float]) -> Callable[[WingMotion], WingMotion | None]:
    return lambda motion: replace(motion, root_pitch=change(motion.root_pitch))


def _level(pitch: float) -> Callable[[Condition], Condition | None]:
    def change(condition: Condition) -> Condition | None:
        new = condition.angle_of_attack * pitch
        return replace(condition, angle_of_attack=new) if abs(new) <= np.pi / 2 * 1.01 else None

    return change


HYPOTHESES: tuple[Hypothesis, ...] = (
    Hypothesis("motion", "the flap angles are in radians, in keys named _deg", _moving(_flap(RADIANS, mean=True))),
    Hypothesis(
        "motion",
        "the flap angle has the whole range (peak to peak) in place of its amplitude",
        _moving(_flap(0.5, mean=False)),
    ),
    Hypothesis("motion", "the flap angle has half of the amplitude", _moving(_flap(2.0, mean=False))),
    Hypothesis("motion", "the sign of the flap angle", _moving(_flap(-1.0, mean=False))),
    Hypothesis(
        "motion",
        "the wing pitch is in radians, in keys named _deg",
        _moving(_pitch(lambda p: _waves(p, RADIANS, p.mean * RADIANS))),
    ),
    Hypothesis("motion", "the sign of the wing pitch", _moving(_pitch(lambda p: _waves(p, -1.0, p.mean)))),
    Hypothesis(
        "motion",
        "the wing pitch is measured from the chord along the body, not from across it",
        _moving(_pitch(lambda p: _waves(p, 1.0, p.mean + np.pi / 2))),
    ),
    Hypothesis(
        "motion",
        "the wing pitch has the whole range (peak to peak) in place of its amplitude",
        _moving(_pitch(lambda p: _waves(p, 0.5, p.mean))),
    ),
    Hypothesis("motion", "root_pitch_deg is in radians", _moving(_root(lambda x: x * RADIANS))),
    Hypothesis(
        "motion", "root_pitch_deg is measured from the chord along the body", _moving(_root(lambda x: x + np.pi / 2))
    ),
    Hypothesis("airspeed", "the airspeed is in km/h", _air(lambda c: replace(c, airspeed=c.airspeed / 3.6))),
    Hypothesis("airspeed", "the airspeed is in knots", _air(lambda c: replace(c, airspeed=c.airspeed * 0.514444))),
    Hypothesis("body pitch", "the body pitch is in radians, in the key body_pitch_deg", _air(_level(RADIANS))),
    Hypothesis("body pitch", "the sign of the body pitch: positive nose up", _air(_level(-1.0))),
    Hypothesis(
        "body pitch",
        "the body pitch is measured from the vertical, not from level",
        _air(lambda c: replace(c, angle_of_attack=np.pi / 2 - c.angle_of_attack)),
    ),
    Hypothesis(
        "air pressure",
        "the pressure is in kPa",
        _air(lambda c: replace(c, pressure=10 * c.pressure) if c.pressure < 12e3 else None),
    ),
)


def body_pitches(pitch: Array) -> tuple[tuple[Array, str], ...]:
    """Return the body pitch [N] (rad) without each of the usual mistakes, and the mistake in words."""
    return (
        (np.degrees(pitch), "the body pitch is in radians, in the key body_pitch_deg"),
        (np.pi / 2 - pitch, "the body pitch is measured from the vertical, not from level"),
        (-pitch, "the sign of the body pitch: positive nose up"),
    )
