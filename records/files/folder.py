"""A dataset as files: ``dataset.yaml`` and ``recordings/<name>.csv``, in a folder or an archive."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Protocol

from wingfit.records.dataset import Dataset
from wingfit.records.description.dataset_file import VehicleDatasetFile, model_of
from wingfit.records.description.yaml_text import read_yaml, write_yaml
from wingfit.records.errors import DatasetError, Faults, check_most, fail
from wingfit.records.files.assemble import assemble, checked_description
from wingfit.records.files.forces import read_forces
from wingfit.records.files.table import Samples, write_table
from wingfit.records.files.tracks import read_tracks
from wingfit.records.limits import MAX_ENTRIES, MAX_EXPANDED_BYTES, MIB

DESCRIPTION = "dataset.yaml"
RECORDINGS = "recordings"


class Files(Protocol):
    """A folder or archive."""

    @property
    def label(self) -> str:
        """Its name in messages."""
        ...

    def names(self) -> list[str]:
        """Names of all files, folders separated by '/'."""
        ...

    def read(self, name: str) -> bytes:
        """Contents of a file."""
        ...


class FolderFiles:
    """Files in a folder."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.label = str(path)

    def names(self) -> list[str]:
        """Files that may belong to a dataset: those of the folder and of ``recordings``."""
        top = [path.name for path in self.path.iterdir() if path.is_file()]
        inner = [f"{RECORDINGS}/{p.name}" for p in (self.path / RECORDINGS).glob("*") if p.is_file()]
        names = top + inner
        check_most(self.label, "holds", len(names), MAX_ENTRIES, "files", "is this the right folder?")
        return names

    def read(self, name: str) -> bytes:
        """Contents of a file; DatasetError if it is too large or not readable."""
        path = self.path / name
        try:
            check_most(name, "is", path.stat().st_size / MIB, MAX_EXPANDED_BYTES / MIB, "MiB", "split it")
            return path.read_bytes()
        except OSError as error:
            raise fail(name, None, f"cannot be read: {error.strerror}; check its permissions") from None


def read_files(files: Files) -> Dataset:
    """Read a dataset; DatasetError lists its errors."""
    names = files.names()
    if DESCRIPTION not in names:
        raise fail(files.label, None, _no_description(names))
    document = read_yaml(files.read(DESCRIPTION), DESCRIPTION)
    markers = document.names("wing", "markers")
    listed = document.names("recordings")

    def read(name: str, room: int) -> Samples:
        file = sample_file(name)
        if file not in names:
            place = ("recordings", listed.index(name), "name") if name in listed else ("recordings",)
            raise fail(document.where(place), name, _no_samples(file, names))
        if model_of(document.data) is VehicleDatasetFile:
            return read_forces(files.read(file), file, room)
        return read_tracks(files.read(file), file, markers, room)

    faults, dataset = Faults(), None
    try:
        dataset = assemble(
            document, read, sample_file, lambda name, s, row: f"{sample_file(name)}, line {s.lines[row]}"
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


def contents(dataset: Dataset) -> dict[str, bytes]:
    """Contents of the files of ``dataset`` by name, sorted; DatasetError if it violates the format."""
    files = {DESCRIPTION: write_yaml(checked_description(dataset)).encode()}
    for recording in sorted(dataset.recordings, key=lambda r: r.name):
        columns = [f"{channel}_{'n' if recording.forces else 'm'}" for channel in recording.channels]
        files[sample_file(recording.name)] = write_table(columns, recording.times, recording.values).encode()
    return files


def write_folder(dataset: Dataset, path: Path) -> None:
    """Write ``dataset`` into a new or empty folder; DatasetError if it is not empty."""
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise fail(str(path), None, "exists and is not an empty folder; choose a new name or remove it first")
    for name, data in contents(dataset).items():
        target = path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(data)


def sample_file(name: str) -> str:
    """Name of the file with the samples of a recording."""
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
