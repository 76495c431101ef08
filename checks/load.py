"""Reads datasets with all checks: a certain mistake is refused, a doubtful one is a warning."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from wingfit.checks.examine import examine
from wingfit.checks.guard import is_finding
from wingfit.checks.mistake import Mistake
from wingfit.records import AnyDataset, DatasetError, load_archive
from wingfit.records import load_dataset as read_dataset


class DatasetWarning(UserWarning):
    """Warns of a likely mistake in a dataset that was read."""


class Checked(NamedTuple):
    """A dataset, and the ``mistakes`` in it: certain ones first, by :attr:`wingfit.checks.Mistake.certain`."""

    dataset: AnyDataset
    mistakes: tuple[Mistake, ...]


def load_dataset(path: str | Path) -> AnyDataset:
    """Read and check the dataset in the folder, zip or NetCDF file ``path``.

    DatasetError lists its errors, and mistakes that are certain; doubtful ones are warned about (DatasetWarning).
    """
    checked = _accepted(check_dataset(path))
    for one in checked.mistakes:
        warnings.warn(str(one), DatasetWarning, stacklevel=2)
    return checked.dataset


def check_dataset(path: str | Path) -> Checked:
    """Read the dataset at ``path`` and return it with all likely mistakes, also those with which it is refused.

    DatasetError for a dataset that cannot be read, or that has an error which the mistakes do not explain.
    """
    return _checked(lambda plausible: read_dataset(path, plausible=plausible))


def check_archive(data: bytes, filename: str) -> Checked:
    """Read the bytes ``data`` of a zip or NetCDF file; DatasetError lists errors and mistakes that are certain."""
    return _accepted(_checked(lambda plausible: load_archive(data, filename, plausible=plausible)))


def _checked(load: Callable[[bool], AnyDataset]) -> Checked:
    try:
        dataset = load(True)
    except DatasetError:
        # A wrong unit of length, force or time is refused where files are read, in words that know less.
        dataset = load(False)
        mistakes = tuple(one for one in examine(dataset) if is_finding(one))
        if not mistakes:
            raise
        return Checked(dataset, tuple(replace(one, certain=True) for one in mistakes))
    return Checked(dataset, examine(dataset))


def _accepted(checked: Checked) -> Checked:
    refuse(checked.mistakes)
    return checked


def refuse(mistakes: tuple[Mistake, ...]) -> None:
    """Raise DatasetError with the ``mistakes`` that are certain, if there are any."""
    certain = [one.fault for one in mistakes if one.certain]
    if certain:
        raise DatasetError(certain)
