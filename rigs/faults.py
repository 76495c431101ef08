"""Faults of the channels and inputs of any rig: what may be wrong with how something was measured or commanded.

Each is off, exactly, at zero. Bounds follow from the recordings: their largest values, ranges and sampling intervals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from typing import NamedTuple

import numpy as np
import scipy

from wingfit.records import Gene
from wingfit.records.array_types import Array
from wingfit.records.series import Series
from wingfit.rigs.ports import Values
from wingfit.rigs.run import Run
from wingfit.rigs.suspect import Family, Suspect

LATEST = 20.0  # sampling intervals: longest delay and longest time constant of a filter
GAIN = 0.3  # largest error of a gain, of 1
RATE = 0.05  # largest error of the rate of a clock, of 1
CROSSTALK = 0.5  # largest part of one channel that another shows, both relative to their ranges
MAX_CROSSTALK = 12  # pairs of channels that are tried
FILL = 1e-300

Channels = dict[str, Array]


@dataclass(frozen=True)
class Scales:
    """What the bounds of faults follow from: range and largest value of each channel or input, and the interval (s).

    The range of one that never changes is its largest value.
    """

    span: Mapping[str, float]
    largest: Mapping[str, float]
    units: Mapping[str, str]
    interval: float

    @classmethod
    def of(cls, recordings: Sequence[Series], units: Mapping[str, str]) -> Scales:
        """Return the scales of ``recordings``; ``units`` of channels and inputs by name."""
        span, largest = dict.fromkeys(units, 0.0), dict.fromkeys(units, 0.0)
        for one in recordings:
            columns = dict(zip(one.channels, one.values.T, strict=True)) | dict(one.inputs)
            for name, values in columns.items():
                known = values[np.isfinite(values)]
                if name in span and len(known):
                    span[name] = max(span[name], float(np.ptp(known)))
                    largest[name] = max(largest[name], float(np.abs(known).max()))
        span = {name: value or largest[name] or 1.0 for name, value in span.items()}
        steps = np.concatenate([np.diff(one.times) for one in recordings if len(one.times) > 1] or [np.ones(1)])
        return cls(span, largest, units, float(np.median(steps)))


class Fault(NamedTuple):
    """A fault: its suspect, and what it changes.

    ``before`` changes what is simulated (a run and the gene values), ``after`` the simulated channels; None: nothing.
    """

    suspect: Suspect
    before: Callable[[Run, Values], Run] | None = None
    after: Callable[[Channels, Run, Values], Channels] | None = None


def channel_faults(names: Sequence[str], scales: Scales) -> dict[str, Fault]:
    """Return the faults of the channels ``names``, by name of the suspect."""
    faults = [fault for name in names for fault in _of_channel(name, scales)]
    pairs = list(permutations(names, 2))
    faults += [_crosstalk(*pair, scales) for pair in (pairs if len(pairs) <= MAX_CROSSTALK else [])]
    return {fault.suspect.name: fault for fault in [*faults, _clock()]}


def input_faults(names: Sequence[str], scales: Scales) -> dict[str, Fault]:
    """Return the faults of the inputs ``names``, by name of the suspect."""
    return {fault.suspect.name: fault for name in names for fault in _of_input(name, scales)}


Change = Callable[[Array, Array, float], Array]
"""Changes samples [T] at times [T] (s) by a fault of the given size."""


def _gain(values: Array, _: Array, error: float) -> Array:
    return np.asarray(values * (1.0 + error))


def _offset(values: Array, _: Array, size: float) -> Array:
    return np.asarray(values + size)


def _drift(values: Array, times: Array, size: float) -> Array:
    return np.asarray(values + size * (times - times[0]) / max(float(times[-1] - times[0]), FILL))


def _delay(values: Array, times: Array, delay: float) -> Array:
    """Return ``values`` [T] as they were ``delay`` (s) earlier, by a cubic spline; the first and last go on at ends."""
    if len(times) < 4 or delay == 0.0:
        return values
    at = np.clip(times - delay, times[0], times[-1])
    return np.asarray(scipy.interpolate.make_interp_spline(times, values, 3)(at))


def _delayed_input(values: Array, times: Array, delay: float) -> Array:
    return values if delay == 0.0 else np.asarray(np.interp(times - delay, times, values))


def _low_pass(values: Array, times: Array, constant: float) -> Array:
    """Return ``values`` [T] behind a first-order low-pass with the time ``constant`` (s), at rest at the start."""
    if constant <= 0.0:
        return values
    found = values.copy()
    for k in range(1, len(values)):  # exact where the input is linear between samples
        step = times[k] - times[k - 1]
        lag = constant * (values[k] - values[k - 1]) / step
        found[k] = values[k] - lag + (found[k - 1] - values[k - 1] + lag) * np.exp(-step / constant)
    return found


def _saturation(largest: float) -> Change:
    """Return a limit of the recorder: the part of ``largest``, the largest value recorded, by which it is less."""

    def change(values: Array, _: Array, part: float) -> Array:
        limit = (1.0 - part) * largest
        return values if part == 0.0 else np.asarray(np.clip(values, -limit, limit))

    return change


def _suspect(name: str, title: str, family: Family, gene: tuple[str, str, float, float], typical: float) -> Suspect:
    suffix, unit, low, high = gene
    own = Gene(f"{name}.{suffix}", unit, 0.0, low, high, "linear", title)
    return Suspect(name, title, family, (own,), typical={own.name: typical}, source="fault of a sensor or a command")


def _of_channel(name: str, scales: Scales) -> Iterator[Fault]:
    span, unit, slow = scales.span[name], scales.units[name], LATEST * scales.interval
    rows: tuple[tuple[str, str, tuple[str, str, float, float], float, Change], ...] = (
        ("gain", "gain error", ("error", "1", -GAIN, GAIN), 0.05, _gain),
        ("offset", "offset", ("size", unit, -span, span), 0.1 * span, _offset),
        ("drift", "drift", ("size", unit, -span, span), 0.1 * span, _drift),
        ("delay", "delay", ("time", "s", -slow, slow), 0.1 * slow, _delay),
        ("low_pass", "low-pass filter", ("constant", "s", 0.0, slow), 0.1 * slow, _low_pass),
        ("saturation", "saturation", ("part", "1", 0.0, 0.9), 0.1, _saturation(scales.largest[name])),
    )
    for kind, title, gene, typical, change in rows:
        suspect = _suspect(f"{kind}.{name}", f"{title} of {name}", "measurement", gene, typical)
        yield Fault(suspect, after=_after(name, suspect.genes[0].name, change))


def _after(name: str, gene: str, change: Change) -> Callable[[Channels, Run, Values], Channels]:
    return lambda channels, run, values: channels | {name: change(channels[name], run.times, values[gene])}


def _of_input(name: str, scales: Scales) -> Iterator[Fault]:
    span, unit, slow = scales.span[name], scales.units[name], LATEST * scales.interval
    rows: tuple[tuple[str, str, tuple[str, str, float, float], float, Change], ...] = (
        ("gain", "gain error", ("error", "1", -GAIN, GAIN), 0.05, _gain),
        ("offset", "offset", ("size", unit, -span, span), 0.1 * span, _offset),
        ("delay", "delay", ("time", "s", -slow, slow), 0.1 * slow, _delayed_input),
    )
    for kind, title, gene, typical, change in rows:
        suspect = _suspect(f"{kind}.{name}", f"{title} of {name}", "input", gene, typical)
        yield Fault(suspect, before=_before(name, suspect.genes[0].name, change))


def _before(name: str, gene: str, change: Change) -> Callable[[Run, Values], Run]:
    def before(run: Run, values: Values) -> Run:
        return replace(run, inputs={**run.inputs, name: change(run.inputs[name], run.input_times, values[gene])})

    return before


def _crosstalk(name: str, other: str, scales: Scales) -> Fault:
    title = f"crosstalk of {other} into {name}"
    gene = ("part", "1", -CROSSTALK, CROSSTALK)
    suspect = _suspect(f"crosstalk.{name}.{other}", title, "measurement", gene, 0.05)
    ratio, part = scales.span[name] / scales.span[other], suspect.genes[0].name

    def after(channels: Channels, _: Run, values: Values) -> Channels:
        return channels | {name: channels[name] + values[part] * ratio * channels[other]}

    return Fault(suspect, after=after)


def _clock() -> Fault:
    suspect = _suspect("clock", "wrong rate of the recorder's clock", "measurement", ("rate", "1", -RATE, RATE), 0.005)

    def before(run: Run, values: Values) -> Run:
        factor, start = 1.0 + values["clock.rate"], run.times[0]
        times, inputs = (start + (one - start) * factor for one in (run.times, run.input_times))
        return replace(run, times=times, input_times=inputs)

    return Fault(suspect, before=before)
