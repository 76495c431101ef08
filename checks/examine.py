"""All checks of a dataset, in the order in which one mistake hides another."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

from wingfit.checks.axes import check_shape
from wingfit.checks.conditions import check_conditions
from wingfit.checks.drive import check_drive
from wingfit.checks.forces import check_forces
from wingfit.checks.frequency import check_frequency
from wingfit.checks.guard import guarded
from wingfit.checks.markers import check_markers
from wingfit.checks.mistake import Kind, Mistake, together
from wingfit.checks.recordings import check_recordings
from wingfit.checks.tracked import Tracked
from wingfit.checks.zeros import check_zero_forces
from wingfit.records import AnyDataset, Dataset, Recording, Wing
from wingfit.records.blas_threads import one_blas_thread
from wingfit.records.dataset import AnyKind


@dataclass(frozen=True)
class Check:
    """One of the checks that :func:`examine` carries out.

    Attributes:
        name: what it looks at.
        question: what it answers.
        finds: kinds of the mistakes that it finds; a mistake of a condition may also be found from the forces.
        of: kinds of datasets that it examines.
    """

    name: str
    question: str
    finds: tuple[Kind, ...]
    of: tuple[AnyKind, ...]


_WING: tuple[AnyKind, ...] = ("tracks",)
_VEHICLE: tuple[AnyKind, ...] = ("forces",)
_BEAT: tuple[AnyKind, ...] = ("tracks", "forces")
_ALL: tuple[AnyKind, ...] = ("tracks", "forces", "series")

CHECKS: tuple[Check, ...] = (
    Check("copies", "Does a recording hold exactly the samples of another one?", ("duplicate",), _ALL),
    Check("constant columns", "Does a column have one value throughout?", ("constant channel",), _ALL),
    Check("steadiness", "Does the rig flap evenly, for a beat at least?", ("unsteady", "cut"), _BEAT),
    Check(
        "conditions", "Are pressure, temperature and airspeed those of an experiment?",
        ("air pressure", "air temperature", "airspeed", "pressure and rig"), _BEAT,
    ),
    Check("masses", "Are densities, thickness and masses those of a wing?", ("density", "thickness", "mass"), _BEAT),
    Check("placeholders", "Is one value written where a sample is missing?", ("placeholders",), _BEAT),
    Check("unit of length", "Are markers as far apart as at rest?", ("length unit", "scale"), _WING),
    Check(
        "axes", "Do the rest positions, turned about the hinge, come near the tracks?",
        ("axes", "side", "origin", "tilt"), _WING,
    ),
    Check("frequency", "Do the samples repeat at the stated flap frequency?", ("frequency", "time unit"), _BEAT),
    Check(
        "single markers", "Does each marker move, without jumps, at the place of its name?",
        ("frozen marker", "swapped markers", "jumps"), _WING,
    ),
    Check(
        "drive", "Do amplitude, mean angle, sign and lag of the drive agree with the tracks?",
        ("amplitude", "mean angle", "vertical sign", "phase lag"), _WING,
    ),
    Check(
        "forces", "Can the described wings and motion cause the forces, and does their mean carry the weight?",
        ("force axes", "force unit", "force phase", "motion", "body pitch", "weight"), _VEHICLE,
    ),
)  # fmt: skip
"""The checks, in the order in which they are carried out."""


@one_blas_thread
def examine(dataset: AnyDataset) -> tuple[Mistake, ...]:
    """Return the likely mistakes in ``dataset``: certain ones first. The same dataset gives the same answer.

    An error inside a check is logged and becomes a warning (:mod:`wingfit.checks.guard`). Of doubtful mistakes, those
    of the kinds that the dataset has ``verified`` are none.
    """
    found = guarded("the recordings", "dataset", lambda: check_recordings(dataset))
    if isinstance(dataset, Dataset):
        found += guarded("the conditions", "dataset", lambda: check_conditions(dataset))
        found += _wing(dataset, dataset.rig) if isinstance(dataset.rig, Wing) else _vehicle(dataset)
    verified = dataset.verified if isinstance(dataset, Dataset) else ()
    doubted = [one for one in found if one.certain or one.kind not in verified]
    merged = together(doubted, len(dataset.recordings))
    return tuple(sorted(merged, key=lambda one: not one.certain))


def _wing(dataset: Dataset, wing: Wing) -> Iterator[Mistake]:
    """Placeholders and units first, then axes; frequency, markers and drive only of recordings whose shape fits."""
    good, indices = list[Tracked](), list[int]()
    known = {marker.name for marker in wing.markers}
    for index, recording in enumerate(dataset.recordings):
        if not recording.markers or any(name not in known for name in recording.markers):
            continue
        found, tracked = _recording(recording, wing, index)
        yield from found
        if tracked is not None:
            good.append(tracked)
            indices.append(index)
    yield from guarded("the drive", "dataset", lambda: check_drive(good, indices))


def _recording(recording: Recording, wing: Wing, index: int) -> tuple[list[Mistake], Tracked | None]:
    """Return the mistakes in one recording of a wing, and the recording for further checks if its shape fits."""
    where = f"recording {recording.name!r}"
    fitted = list[Tracked]()
    failed = guarded("the markers", where, lambda: fitted.append(Tracked.of(recording, wing)))
    if not fitted:
        return failed, None
    tracked = fitted[0]
    markers = guarded("the markers", where, lambda: check_markers(tracked))
    if any(one.kind == "placeholders" for one in markers):
        return markers, None
    if shape := guarded("the axes", where, lambda: check_shape(tracked)):
        return shape, None
    repeats = guarded("the frequency", where, lambda: check_frequency(recording, index))
    return markers + repeats, None if repeats else tracked


def _vehicle(dataset: Dataset) -> Iterator[Mistake]:
    blocked = False
    for index, recording in enumerate(dataset.recordings):
        where = f"recording {recording.name!r}"
        found = guarded("zero forces", where, partial(check_zero_forces, recording))
        found = found or guarded("the frequency", where, partial(check_frequency, recording, index))
        yield from found
        blocked |= bool(found)
    if not blocked:  # estimates, of which some model may have no gene, do not matter: its coefficients are free
        plain = replace(dataset, rig=replace(dataset.vehicle, estimates={}))
        yield from guarded("the forces", "dataset", lambda: check_forces(plain))
