"""From a description and tracks, however stored, to a dataset; and the same checks before writing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from records.convert import describe, to_condition, to_deviations, to_wing
from records.dataset import Dataset, Recording
from records.errors import DatasetError, Faults, nearest
from records.explain import check_description
from records.limits import MAX_VALUES
from records.plausibility import check_numbers
from records.tracks import Tracks, too_much
from records.yaml_text import Document

ReadTracks = Callable[[str, int], Tracks]
At = Callable[[str, Tracks, int], str]


def assemble(document: Document, read: ReadTracks, where: Callable[[str], str], at: At) -> Dataset:
    """Build the dataset described by ``document``.

    ``read(name, room)`` gives the tracks of a recording of at most ``room`` numbers, ``where(name)``
    says where they are stored, ``at(name, tracks, row)`` where one instant is. Faults of all recordings are
    collected.
    """
    checked = check_description(document)
    wing, faults, recordings, room = to_wing(checked.wing), Faults(), [], MAX_VALUES
    for index, entry in enumerate(checked.recordings):
        try:
            tracks = read(entry.name, room)
        except DatasetError as error:
            faults.extend(error)
            continue
        room -= tracks.values.size + tracks.times.size
        check_numbers(
            tracks.times,
            tracks.values,
            wing,
            where(entry.name),
            lambda row, name=entry.name, tracks=tracks: at(name, tracks, row),  # type: ignore[misc]
            faults,
        )
        path = ("recordings", index, "standard_deviation_m")
        noise = to_deviations(entry, tracks.markers, document, path, faults)
        recordings.append(
            Recording(entry.name, entry.rig, to_condition(entry), tracks.times, tracks.markers, tracks.values, noise)
        )
        if faults.full:
            break
    faults.raise_any()
    return Dataset(checked.name, wing, tuple(recordings), tuple(checked.held_out), checked.description)


def checked_description(dataset: Dataset) -> dict[str, object]:
    """Describe ``dataset``, after the checks that reading makes: what is written can be read."""
    faults = Faults()
    for recording in dataset.recordings:
        _check_shapes(recording, faults)
    faults.raise_any()
    data = describe(dataset)
    check_description(Document(f"dataset {dataset.name!r}", data))
    numbers = 0
    for recording in dataset.recordings:
        where = f"recording {recording.name!r}"
        _check_markers(recording, dataset, where, faults)
        check_numbers(
            recording.times,
            recording.values,
            dataset.wing,
            where,
            lambda row, where=where: f"{where}, frame {row}",  # type: ignore[misc]
            faults,
        )
        numbers += recording.values.size + recording.times.size
    if numbers > MAX_VALUES:
        faults.extend(too_much(f"dataset {dataset.name!r}"))
    faults.raise_any()
    return data


def _check_shapes(recording: Recording, faults: Faults) -> None:
    where, times, channels = f"recording {recording.name!r}", len(recording.times), 3 * len(recording.markers)
    wanted = {"times": (times,), "values": (times, channels), "standard_deviation": (channels,)}
    for name, shape in wanted.items():
        array = getattr(recording, name)
        if array is None:
            continue
        if np.shape(array) != shape or np.asarray(array).dtype != np.float64:
            found = f"{np.asarray(array).dtype} {list(np.shape(array))}"
            faults.add(
                f"{where}: {name}",
                found,
                f"is {found}; it must be float64 {list(shape)}: convert or transpose it",
            )


def _check_markers(recording: Recording, dataset: Dataset, where: str, faults: Faults) -> None:
    known = [marker.name for marker in dataset.wing.markers]
    for index, name in enumerate(recording.markers):
        if name not in known:
            faults.add(where, name, f"no marker of the wing is called {name!r}; {nearest(name, known)}")
        if name in recording.markers[:index]:
            faults.add(where, name, f"marker {name!r} stands twice; keep one")
