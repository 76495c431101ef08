"""Checks of a series in memory, also used where files are read: shapes, order of times, finite numbers, names."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from numbers import Real
from typing import Protocol

import numpy as np

from wingfit.records.array_types import Array, Float
from wingfit.records.errors import Faults, nearest
from wingfit.records.limits import LARGEST, SMALLEST

Locate = Callable[[int], str]
SHOWN = 3
GENE_BRACKETS = "[]"
SAMPLES_PER_PERIOD = 2  # at least; fewer show not even the first harmonic
IN_RANGE = f"from -{LARGEST:g} to {LARGEST:g}"


class _Named(Protocol):
    @property
    def name(self) -> str: ...


class _WithSettings(_Named, Protocol):
    @property
    def settings(self) -> Mapping[str, object]: ...


class _Recording(_Named, Protocol):
    """A :class:`wingfit.records.series.Series`, whose module imports this one."""

    @property
    def settings(self) -> Mapping[str, float]: ...
    @property
    def times(self) -> Float[Array, " T"]: ...
    @property
    def values(self) -> Float[Array, "T C"]: ...
    @property
    def quantities(self) -> Sequence[_Named]: ...
    @property
    def inputs(self) -> Mapping[str, Float[Array, " T"]]: ...
    @property
    def estimates(self) -> Mapping[str, float]: ...
    @property
    def period(self) -> float | None: ...


class _Dataset(_Named, Protocol):
    """A :class:`wingfit.records.series.SeriesDataset`."""

    @property
    def recordings(self) -> Sequence[_Recording]: ...
    @property
    def channels(self) -> Sequence[_Named]: ...
    @property
    def inputs(self) -> Sequence[_Named]: ...
    @property
    def settings(self) -> Sequence[_Named]: ...
    @property
    def held_out(self) -> Sequence[str]: ...


def check_recording(recording: _Recording) -> None:
    """Raise DatasetError unless shapes fit, times increase, and inputs, settings and estimates are finite."""
    where, faults = f"recording {recording.name!r}", Faults()
    if set(recording.name) & set(GENE_BRACKETS):
        message = "has a bracket, which marks the recording in the name of a gene, as in angle0[first]; rename it"
        faults.add(f"{where}: name", recording.name, message)
    _check_shapes(recording, where, faults)
    faults.raise_any()
    check_samples(recording.times, recording.values, recording.inputs, f"{where}, sample {{}}".format, faults)
    for what, numbers in (("settings", recording.settings), ("estimates", recording.estimates)):
        for name, value in numbers.items():
            if not isinstance(value, Real) or not abs(value) <= LARGEST:
                faults.add(f"{where}: {what}.{name}", value, f"is {_plain(value)}; give a finite number, {IN_RANGE}")
    step = float(np.median(np.diff(recording.times))) if len(recording.times) > 1 else 0.0
    if recording.period is not None and not SMALLEST <= recording.period <= LARGEST:
        message = f"is {_plain(recording.period)} s; give a positive number of seconds, or None if it is not periodic"
        faults.add(f"{where}: period", recording.period, message)
    elif recording.period is not None and recording.period < SAMPLES_PER_PERIOD * step:
        message = (
            f"is {_plain(recording.period)} s, but samples are {_plain(step)} s apart; a period needs at least "
            f"{SAMPLES_PER_PERIOD} samples: correct it, or leave it out"
        )
        faults.add(f"{where}: period", recording.period, message)
    faults.raise_any()


def check_recordings(dataset: _Dataset) -> None:
    """Raise DatasetError unless names are unique, and all recordings hold what ``dataset`` lists."""
    where, faults = f"dataset {dataset.name!r}", Faults()
    names = [one.name for one in dataset.recordings]
    for index, name in enumerate(names):
        if name in names[:index]:
            faults.add(f"{where}: recordings[{index}]", name, used_twice(name))
    for name in dataset.held_out:
        if name not in names:
            faults.add(f"{where}: held_out", name, unknown("recording", name, names))
    for recording in dataset.recordings:
        _check_quantities(recording, dataset, faults)
    for index, name in unstated(dataset.recordings, dataset.settings):
        faults.add(f"{where}: recordings[{index}]", None, not_stated(names[index], name))
    faults.raise_any()


def used_twice(name: str) -> str:
    """Return the message about a ``name`` that is used before."""
    return f"{name!r} is used a second time here; every name must be unique: rename one"


def unknown(what: str, name: str, known: Sequence[str]) -> str:
    """Return the message about the ``name`` of a ``what``, such as "recording", that is not among the ``known``."""
    return f"no {what} is called {name!r}; {nearest(name, known)}"


def unstated(recordings: Sequence[_WithSettings], settings: Sequence[_Named]) -> Iterator[tuple[int, str]]:
    """Yield the index of a recording and the name of a setting, for each of ``settings`` that it does not state."""
    for index, recording in enumerate(recordings):
        yield from ((index, one.name) for one in settings if one.name not in recording.settings)


def not_stated(recording: str, setting: str) -> str:
    """Return the message about a ``setting`` that the recording of this name does not state."""
    return f"recording {recording!r} does not state the setting {setting!r}; add its value"


def check_samples(
    times: Float[Array, " T"],
    values: Float[Array, "T C"],
    inputs: Mapping[str, Float[Array, " T"]],
    at: Locate,
    faults: Faults,
) -> bool:
    """Add faults where times do not increase, a value is infinite or an input is not finite; ``at(row)`` is a place.

    Returns whether the times are finite and increase.
    """
    increasing = check_times(times, at, faults)
    steps = np.diff(times) if increasing else np.ones(0)
    for row in np.flatnonzero(steps < SMALLEST)[:SHOWN] + 1:
        message = f"time_s is {float(steps[row - 1]):g} s after the one above; give times at least {SMALLEST:g} s apart"
        faults.add(at(int(row)), times[row], message)
    for row in np.flatnonzero(np.isinf(values).any(axis=1))[:SHOWN]:
        faults.add(at(int(row)), "inf", "a channel is infinite; it must be finite, or missing")
    for what, numbers in (("a channel", values), *((f"input {name!r}", one) for name, one in inputs.items())):
        sizes = np.abs(np.where(np.isfinite(numbers), numbers, 0.0))
        largest = sizes.reshape(len(numbers), -1 if sizes.size else 0).max(axis=1, initial=0.0)
        for row in np.flatnonzero(largest > LARGEST)[:SHOWN]:
            message = f"{what} is {largest[row]:.3g}; give a number {IN_RANGE}: use another unit, or correct it"
            faults.add(at(int(row)), float(largest[row]), message)
    for name, samples in inputs.items():
        for row in np.flatnonzero(~np.isfinite(samples))[:SHOWN]:
            message = (
                f"input {name!r} has no finite value; an input needs one in every row: interpolate, or cut the row"
            )
            faults.add(at(int(row)), None, message)
    return increasing


def check_times(times: Float[Array, " T"], at: Locate, faults: Faults) -> bool:
    """Return whether the times [T] (s) are finite and increase; add faults for the first rows at which not."""
    bad = np.flatnonzero(~np.isfinite(times))
    for row in bad[:SHOWN]:
        faults.add(at(int(row)), times[row], "time_s is missing or not finite; every row needs its time in seconds")
    if bad.size:
        return False
    for row in np.flatnonzero(np.abs(times) > LARGEST)[:SHOWN]:
        faults.add(at(int(row)), times[row], f"time_s is {times[row]:.3g} s; give a time {IN_RANGE}")
    back = np.flatnonzero(np.diff(times) <= 0) + 1
    for row in back[:SHOWN]:
        before, here = float(times[row - 1]), float(times[row])
        how = "the same as" if here == before else "before"
        message = f"time_s is {here!r} s, {how} the one above, {before!r} s; times must increase: sort the rows"
        faults.add(at(int(row)), here, message)
    return not back.size


def _check_shapes(recording: _Recording, where: str, faults: Faults) -> None:
    times = np.size(recording.times)
    wanted: list[tuple[str, object, tuple[int, ...]]] = [
        ("times", recording.times, (times,)),
        ("values", recording.values, (times, len(recording.quantities))),
        *((f"inputs[{name!r}]", samples, (times,)) for name, samples in recording.inputs.items()),
    ]
    for what, array, shape in wanted:
        if np.shape(np.asarray(array)) != shape or np.asarray(array).dtype != np.float64:
            found = f"{np.asarray(array).dtype} {list(np.shape(np.asarray(array)))}"
            message = f"is {found}; it must be float64 {list(shape)}: convert or transpose it"
            faults.add(f"{where}: {what}", found, message)


def _check_quantities(recording: _Recording, dataset: _Dataset, faults: Faults) -> None:
    where = f"recording {recording.name!r}"
    if recording.quantities != dataset.channels:
        message = "are not the channels of the dataset; all recordings must have these, in the same order"
        faults.add(f"{where}: quantities", ", ".join(one.name for one in recording.quantities), message)
        return
    listed = [one.name for one in dataset.inputs]
    for name in recording.inputs:
        if name not in listed:
            faults.add(f"{where}: inputs", name, unknown("input of the dataset", name, listed))
    for name in listed:
        if name not in recording.inputs:
            faults.add(f"{where}: inputs", None, f"the input {name!r} of the dataset is missing; add it")


def _plain(value: object) -> str:
    if not isinstance(value, Real):
        return repr(value)
    return "NaN" if np.isnan(float(value)) else f"{float(value):g}"
