"""Reads and writes a dataset as files ``dataset.yaml`` and ``recordings/<name>.csv``, in a folder or a zip."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence
from pathlib import Path

from wingfit.records.array_types import Array
from wingfit.records.dataset import AnyDataset, AnyRecording
from wingfit.records.description.dataset_file import SeriesDatasetFile, VehicleDatasetFile, model_of
from wingfit.records.description.yaml_text import read_yaml, write_yaml
from wingfit.records.errors import DatasetError, Faults, check_most, fail
from wingfit.records.files.assemble import assemble, checked_description
from wingfit.records.files.forces import read_forces
from wingfit.records.files.series_dataset import samples_of
from wingfit.records.files.series_table import Columns, read_series
from wingfit.records.files.table import Samples, write_table
from wingfit.records.files.tracks import read_tracks
from wingfit.records.limits import MAX_ENTRIES, MAX_EXPANDED_BYTES, MIB
from wingfit.records.series import Series

DESCRIPTION = "dataset.yaml"
RECORDINGS = "recordings"


def read_folder(path: Path, *, plausible: bool = True) -> AnyDataset:
    """Read the dataset in the folder ``path``; DatasetError lists its errors, without ``plausible`` fewer."""
    top = [file.name for file in path.iterdir() if file.is_file()]
    names = top + [f"{RECORDINGS}/{file.name}" for file in (path / RECORDINGS).glob("*") if file.is_file()]
    check_most(str(path), "holds", len(names), MAX_ENTRIES, "files", "is this the right folder?")

    def read(name: str) -> bytes:
        try:
            check_most(name, "is", (path / name).stat().st_size / MIB, MAX_EXPANDED_BYTES / MIB, "MiB", "split it")
            return (path / name).read_bytes()
        except OSError as error:
            raise fail(name, None, f"cannot be read: {error.strerror}; check its permissions") from None

    return read_files(str(path), names, read, plausible=plausible)


def read_files(
    label: str, names: list[str], contents_of: Callable[[str], bytes], *, plausible: bool = True
) -> AnyDataset:
    """Read a dataset from the files ``names`` (folders separated by "/"); DatasetError lists its errors.

    ``contents_of(name)`` returns the bytes of a file. ``label`` names the folder or zip in messages. ``plausible``:
    also refuse implausible units and sampling.
    """
    if DESCRIPTION not in names:
        raise fail(label, None, _no_description(names))
    document = read_yaml(contents_of(DESCRIPTION), DESCRIPTION)
    markers = document.names("wing", "markers")
    listed = document.names("recordings")

    def read(name: str, room: int) -> Samples:
        file = sample_file(name)
        if file not in names:
            place = ("recordings", listed.index(name), "name") if name in listed else ("recordings",)
            raise fail(document.where(place), name, _no_samples(file, names))
        model = model_of(document.data)
        if model is SeriesDatasetFile:
            return read_series(contents_of(file), file, Columns.of(document), room)
        if model is VehicleDatasetFile:
            return read_forces(contents_of(file), file, room)
        return read_tracks(contents_of(file), file, markers, room)

    faults, dataset = Faults(), None
    try:
        dataset = assemble(
            document,
            read,
            sample_file,
            lambda name, s, row: f"{sample_file(name)}, line {s.lines[row]}",
            plausible=plausible,
        )
    except DatasetError as error:
        faults.extend(error)
    for name in sorted(names):
        stem = name.rpartition("/")[2][: -len(".csv")]
        if name.startswith(f"{RECORDINGS}/") and name.lower().endswith(".csv") and stem not in listed:
            message = f"is not listed in {DESCRIPTION}; add '- name: {stem}' to recordings, or remove it"
            faults.add(name, name, message)
    faults.raise_any()
    assert dataset is not None  # noqa: S101 - otherwise there was a fault
    return dataset


def contents(dataset: AnyDataset, *, plausible: bool = True) -> dict[str, bytes]:
    """Return the contents of the files of ``dataset`` by file name; DatasetError if it violates the format.

    ``plausible``: also refuse implausible units and sampling.
    """
    files = {DESCRIPTION: write_yaml(checked_description(dataset, plausible=plausible)).encode()}
    for recording in dataset.recordings:
        columns, values = _columns(recording)
        files[sample_file(recording.name)] = write_table(columns, recording.times, values).encode()
    return dict(sorted(files.items()))


def _columns(recording: AnyRecording) -> tuple[Sequence[str], Array]:
    """Return the names of the columns with the samples of ``recording``, and the values in them."""
    if isinstance(recording, Series):
        samples = samples_of(recording)
        return samples.quantities, samples.values
    unit = "n" if recording.forces else "m"
    return [f"{channel}_{unit}" for channel in recording.channels], recording.values


def write_folder(dataset: AnyDataset, path: Path) -> None:
    """Write ``dataset`` into the new or empty folder ``path``; DatasetError if ``path`` is anything else."""
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise fail(str(path), None, "exists and is not an empty folder; choose a new name or remove it first")
    for name, data in contents(dataset).items():
        target = path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(data)


def sample_file(name: str) -> str:
    """Return the path, in the dataset's folder, of the file with the samples of the recording called ``name``."""
    return f"{RECORDINGS}/{name}.csv"


def _no_description(names: list[str]) -> str:
    near = next((n for n in names if n.rpartition("/")[2].lower() in {"dataset.yml", "dataset.yaml"}), None)
    found = f"found {near!r}: rename or move it" if near else "it belongs beside the folder 'recordings'"
    return f"{DESCRIPTION} is missing; {found} (docs/formats.md shows one)"


def _no_samples(file: str, names: list[str]) -> str:
    close = [n for n in names if n.rpartition("/")[2].lower() == file.rpartition("/")[2].lower()]
    close = close or difflib.get_close_matches(file, [n for n in names if n.endswith(".csv")], 1, 0.8)
    hint = f"found {close[0]!r}: rename or move it" if close else "add the file, or remove the recording from the list"
    return f"file {file!r} is missing; {hint}"
