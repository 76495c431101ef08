"""Zeros, or another placeholder, that fill gaps in forces."""

from __future__ import annotations

import numpy as np

from wingfit.checks.harmonics import fit
from wingfit.checks.mistake import Mistake, TableEdit, change_of
from wingfit.records import Recording
from wingfit.records.array_types import Array

REPEATED = 4  # samples with exactly the same value on all axes
COMMON = 2.0  # times as many as of any other number on each axis: a coarse converter repeats all its numbers
OFF = 2.0  # distance of the harmonics from it (root mean square), in standard deviations of the noise


def check_zero_forces(recording: Recording) -> Mistake | None:
    """Return the mistake of a recording of forces where one exact value on all axes fills gaps; else None."""
    values = recording.values
    filled, value = _filled(values)
    count = int(filled.sum())
    if count < REPEATED or filled.mean() > 0.5 or len(values) < 40:
        return None
    rest = np.where(filled[:, None], np.nan, values)
    if count <= COMMON * _repeated(rest):
        return None
    waves = fit(recording.times, rest, recording.condition.flap_frequency, 4)
    expected = waves.at(recording.times[filled], recording.condition.flap_frequency)
    off = np.linalg.norm(expected - value, axis=1)
    if float(np.sqrt(np.mean(off**2))) < OFF * float(np.linalg.norm(waves.sigma)):
        return None

    def emptied(times: Array, table: Array, _: tuple[str, ...]) -> tuple[Array, Array]:
        return times, np.where((table == value).all(axis=1)[:, None], np.nan, table)

    edit = TableEdit(recording.name, "all columns of forces", f"{value:g}", "empty cells", emptied)
    return Mistake(
        "placeholders",
        f"recording {recording.name!r}",
        f"{count} samples are exactly {value:g} N on every axis, {np.median(off):.3g} N off the beat",
        "empty cells where nothing was measured",
        f"{value:g} was written for lost samples",
        change_of([edit]),
        True,
        (edit,),
    )


def _filled(values: Array) -> tuple[Array, float]:
    """Mask [T] of the samples that have the same most frequent number on every axis, and this number."""
    same = np.isfinite(values).all(axis=1) & (values == values[:, :1]).all(axis=1)
    if not same.any():
        return same, 0.0
    numbers, counts = np.unique(values[same, 0], return_counts=True)
    value = float(numbers[int(np.argmax(counts))])
    return same & (values[:, 0] == value), value


def _repeated(values: Array) -> int:
    """How often the most frequent number of ``values`` [T, A] occurs, on the axis where that is rarest; NaN is none."""
    found = (np.unique(axis[np.isfinite(axis)], return_counts=True)[1] for axis in values.T)
    return int(min(counts.max(initial=0) for counts in found))
