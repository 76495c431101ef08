"""Builds a dataset from ``dataset.yaml`` and samples, whatever kind of file holds them, and checks both.

The same checks are made before a dataset is written.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from operator import attrgetter
from typing import TypeVar

import numpy as np

from wingfit.records.dataset import AnyDataset, Dataset, Recording
from wingfit.records.description.convert import (
    RecordingFile,
    describe_cameras,
    describe_frame_error,
    describe_recording,
    describe_rig,
    describe_rig_limits,
    to_cameras,
    to_frame_error,
    to_recording,
    to_rig,
    to_rig_limits,
)
from wingfit.records.description.dataset_file import SeriesDatasetFile
from wingfit.records.description.explain import check_description
from wingfit.records.description.series_file import SeriesRecordingFile
from wingfit.records.description.yaml_text import Document
from wingfit.records.errors import DatasetError, Faults, nearest
from wingfit.records.files.forces import AXES
from wingfit.records.files.plausibility import check_numbers
from wingfit.records.files.series_dataset import (
    check_series,
    check_together,
    describe_series,
    to_series,
    to_series_dataset,
)
from wingfit.records.files.table import Samples, too_much
from wingfit.records.files.window import in_window
from wingfit.records.limits import FORMAT_VERSION, MAX_VALUES
from wingfit.records.series import Series, SeriesDataset
from wingfit.records.vehicle import Vehicle

ReadSamples = Callable[[str, int], Samples]
At = Callable[[str, Samples, int], str]
Entry = TypeVar("Entry", RecordingFile, SeriesRecordingFile)


def assemble(
    document: Document,
    read: ReadSamples,
    where: Callable[[str], str],
    at: At,
    room: int = MAX_VALUES,
    *,
    plausible: bool = True,
) -> AnyDataset:
    """Build the dataset described by ``document``, of at most ``room`` numbers; DatasetError lists the faults.

    ``read(name, room)`` returns the samples, at most ``room`` numbers, of the recording called ``name``. For messages,
    ``where(name)`` says where these samples are stored, and ``at(name, samples, row)`` where one row of them is.
    ``plausible``: also refuse implausible units and sampling.
    """
    checked, faults = check_description(document), Faults()
    if isinstance(checked, SeriesDatasetFile):
        series = list[Series]()
        for _, one, samples in _read_all(checked.recordings, read, room, faults):
            found = to_series(checked, one, samples, where(one.name), partial(at, one.name, samples), faults)
            series += [found] if found else []
        faults.raise_any()
        check_together(series, document, faults)
        faults.raise_any()
        return to_series_dataset(checked, series)
    rig, recordings = to_rig(checked), list[Recording]()
    entries: Sequence[RecordingFile] = checked.recordings
    for index, entry, whole in _read_all(entries, read, room, faults):
        samples = in_window(entry, whole, document, ("recordings", index), faults)
        recording = to_recording(entry, samples, document, ("recordings", index), faults)
        place = partial(at, entry.name, samples)
        check_numbers(recording, rig, where(entry.name), place, faults, plausible=plausible)
        recordings.append(recording)
    faults.raise_any()
    frame = to_frame_error(checked)
    held_out, cameras, limits = tuple(checked.held_out), to_cameras(checked), to_rig_limits(checked)
    given = frame, cameras, limits, tuple(dict.fromkeys(checked.verified))
    return Dataset(checked.name, rig, tuple(recordings), held_out, checked.description, *given)


def _read_all(
    entries: Sequence[Entry], read: ReadSamples, room: int, faults: Faults
) -> Iterator[tuple[int, Entry, Samples]]:
    """Yield index, description and samples of each of ``entries`` that can be read, until ``faults`` are many."""
    for index, entry in enumerate(entries):
        try:
            samples = read(entry.name, room)
        except DatasetError as error:
            faults.extend(error)
            continue
        room -= samples.values.size + samples.times.size
        yield index, entry, samples
        if faults.full:
            break


def checked_description(dataset: AnyDataset, *, plausible: bool = True) -> dict[str, object]:
    """Check ``dataset`` as reading does, and return the plain data of ``dataset.yaml``; DatasetError lists errors."""
    faults = Faults()
    if isinstance(dataset, SeriesDataset):
        return _checked_series(dataset, faults)
    for recording in dataset.recordings:
        _check_kind(recording, dataset, faults)
        _check_shapes(recording, faults)
    faults.raise_any()
    data = describe(dataset)
    check_description(Document(f"dataset {dataset.name!r}", data))
    numbers = 0
    for recording in dataset.recordings:
        where = f"recording {recording.name!r}"
        if dataset.kind == "tracks":
            check_markers(recording.markers, [marker.name for marker in dataset.wing.markers], where, faults)
        check_numbers(recording, dataset.rig, where, f"{where}, frame {{}}".format, faults, plausible=plausible)
        numbers += recording.values.size + recording.times.size
    if numbers > MAX_VALUES:
        faults.extend(too_much(f"dataset {dataset.name!r}"))
    faults.raise_any()
    return data


def _checked_series(dataset: SeriesDataset, faults: Faults) -> dict[str, object]:
    data = describe_series(dataset)
    document = Document(f"dataset {dataset.name!r}", data)
    check_description(document)
    numbers = 0
    for recording in dataset.recordings:
        where = f"recording {recording.name!r}"
        own = recording.times, recording.values, recording.inputs, recording.period
        check_series(*own, where, f"{where}, sample {{}}".format, faults)
        numbers += recording.values.size + recording.times.size * (1 + len(recording.inputs))
    if numbers > MAX_VALUES:
        faults.extend(too_much(document.file))
    faults.raise_any()
    check_together(dataset.recordings, document, faults)
    faults.raise_any()
    return data


def describe(dataset: Dataset) -> dict[str, object]:
    """Convert ``dataset``, without its samples, to the plain data of ``dataset.yaml``; nothing is checked."""
    return {
        "format_version": FORMAT_VERSION,
        "name": dataset.name,
        **({"description": dataset.description} if dataset.description else {}),
        "vehicle" if isinstance(dataset.rig, Vehicle) else "wing": describe_rig(dataset.rig),
        **({"frame_error": describe_frame_error(dataset.frame_error)} if dataset.frame_error else {}),
        **({"cameras": describe_cameras(dataset.cameras)} if dataset.cameras else {}),
        **({"rig_limits": describe_rig_limits(dataset.rig_limits, dataset.rig)} if dataset.rig_limits else {}),
        "recordings": [describe_recording(recording) for recording in dataset.recordings],
        **({"held_out": list(dataset.held_out)} if dataset.held_out else {}),
        **({"verified": list(dataset.verified)} if dataset.verified else {}),
    }


def _check_kind(recording: Recording, dataset: Dataset, faults: Faults) -> None:
    """Add a fault for every attribute of ``recording`` that has a value but cannot be stored in files of ``dataset``.

    A dataset of a wing stores no forces, a dataset of a vehicle no markers.
    """
    where, kept = f"recording {recording.name!r}", dataset.kind == "forces"
    lost = ("markers", "condition.phase_lag") if kept else ("forces", "low_pass", "motion", "mass")
    for name in lost:
        if value := attrgetter(name)(recording):
            what = "a vehicle with forces" if kept else "a wing with tracks"
            faults.add(f"{where}: {name}", value, f"has no place in a dataset of {what}: remove it")
    if kept and recording.noise_correlation is not None:
        faults.add(f"{where}: noise_correlation", "", "has no place in a dataset of a vehicle with forces: remove it")
    orders = [AXES[:1], AXES[1:], AXES]
    if kept and recording.forces not in orders:
        message = f"forces are {recording.forces!r}; they must be one of {', '.join(map(str, orders))}"
        faults.add(f"{where}: forces", ", ".join(recording.forces), message)


def _check_shapes(recording: Recording, faults: Faults) -> None:
    where, times, channels = f"recording {recording.name!r}", len(recording.times), len(recording.channels)
    wanted = {
        "times": (times,),
        "values": (times, channels),
        "standard_deviation": (channels,),
        "noise_correlation": (channels // 3, 3),
    }
    for name, shape in wanted.items():
        array = getattr(recording, name)
        if array is None:
            continue
        if np.shape(array) != shape or np.asarray(array).dtype != np.float64:
            found = f"{np.asarray(array).dtype} {list(np.shape(array))}"
            message = f"is {found}; it must be float64 {list(shape)}: convert or transpose it"
            faults.add(f"{where}: {name}", found, message)


def check_markers(markers: Sequence[str], known: Sequence[str], where: str, faults: Faults) -> None:
    """Add a fault for every one of ``markers`` that is not among the wing's ``known`` ones, or that is repeated."""
    for index, name in enumerate(markers):
        if name not in known:
            faults.add(where, name, f"no marker of the wing is called {name!r}; {nearest(name, known)}")
        if name in markers[:index]:
            faults.add(where, name, f"marker {name!r} appears twice; keep one")
