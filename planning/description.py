"""Reads the description of an experiment that has not been recorded: a ``dataset.yaml`` without its files of values."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from wingfit.records.dataset import AnyDataset, Dataset, Recording
from wingfit.records.description.convert import (
    RecordingFile,
    to_cameras,
    to_frame_error,
    to_recording,
    to_rig,
    to_rig_limits,
)
from wingfit.records.description.dataset_file import SeriesDatasetFile
from wingfit.records.description.explain import check_description
from wingfit.records.description.yaml_text import read_yaml
from wingfit.records.errors import Faults, fail
from wingfit.records.files.folder import DESCRIPTION, RECORDINGS
from wingfit.records.files.storage import load_dataset
from wingfit.records.files.table import Samples
from wingfit.records.wing import Wing

BLANK_SAMPLES = 2


def load_planned(path: Path) -> AnyDataset:
    """Read a dataset, or the description of one: a YAML file, or a folder with ``dataset.yaml`` and no recordings.

    All values of a described recording are NaN, and it has all markers, or both forces. DatasetError lists what is
    wrong.
    """
    if path.suffix.lower() in (".yaml", ".yml"):
        return read_described(path)
    if path.is_dir() and (path / DESCRIPTION).is_file() and not any((path / RECORDINGS).glob("*.csv")):
        return read_described(path / DESCRIPTION)
    return load_dataset(path)


def read_described(path: Path) -> Dataset:
    """Read the description of a wing or a vehicle and of its conditions from the YAML file ``path``."""
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise fail(str(path), None, f"cannot be read: {error.strerror}; check the name") from None
    return described(raw, path.name)


def described(raw: bytes, file: str) -> Dataset:
    """Read the description of a wing or a vehicle from the YAML text ``raw``; ``file`` is its name in messages."""
    document = read_yaml(raw, file)
    checked = check_description(document)
    if isinstance(checked, SeriesDatasetFile):
        message = (
            "describes a rig of your own, whose plan needs the times and inputs of recordings: give a folder with "
            "recordings, simulated ones if there are no others"
        )
        raise fail(file, None, message)
    rig, faults, recordings = to_rig(checked), Faults(), list[Recording]()
    markers = tuple(marker.name for marker in rig.markers) if isinstance(rig, Wing) else ()
    forces = () if isinstance(rig, Wing) else ("x", "z")
    channels = 3 * len(markers) + len(forces)
    blank = Samples(
        np.arange(float(BLANK_SAMPLES)),
        np.full((BLANK_SAMPLES, channels), np.nan),
        np.arange(BLANK_SAMPLES),
        markers,
        forces,  # type: ignore[arg-type]
    )
    entries: Sequence[RecordingFile] = checked.recordings
    for k, entry in enumerate(entries):
        recordings.append(to_recording(entry, blank, document, ("recordings", k), faults))
    faults.raise_any()
    held_out, frame, cameras = tuple(checked.held_out), to_frame_error(checked), to_cameras(checked)
    limits = to_rig_limits(checked)
    return Dataset(checked.name, rig, tuple(recordings), held_out, checked.description, frame, cameras, limits)


def is_described(recording: Recording) -> bool:
    """Return whether ``recording`` has no values yet."""
    return not recording.valid.any()
