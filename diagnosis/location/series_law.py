"""Fit a free-form law to the misfit of a series: what is missing in a channel as a function of motion and inputs.

A rig that the user simulates may accept no load, so the law is one of the channel and not of a force: recorded minus
simulated values are a sum of few terms, each a coefficient, the same for all recordings, times a function of what the
fitted nominal model simulates. The functions are powers, sign and products of the channels, their rates and the inputs.
Terms are selected as :mod:`wingfit.diagnosis.location.forward_selection` describes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np

from wingfit.diagnosis.evidence.fit import PRIOR_SD, Fit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.finding import FreeLaw
from wingfit.diagnosis.location.forward_selection import MIN_RECORDINGS, Label, NormalEquations, selected_law
from wingfit.inference.noise.series_fit import SeriesFit
from wingfit.records.array_types import Array, Float
from wingfit.records.series import Series

MOST_VARIABLES = 8  # channels, rates and inputs that enter a law
SMOOTH = 0.02  # of the largest value of a variable: its sign is 3/4 at this value


class _Variable(NamedTuple):
    """A channel, a rate or an input with its unit; ``words`` name it in text."""

    name: str
    words: str
    unit: str


class _Feature(NamedTuple):
    """A function of the variables: formula, words, unit."""

    formula: str
    words: str
    unit: str


def series_law(data: WhitenedData, nominal: Fit, units: Mapping[str, str]) -> FreeLaw | None:
    """Return a law of the misfit of the fitted ``nominal`` model, whose inputs have ``units`` by name.

    None for fewer than three experiments, or without a misfit beyond the noise. A law without terms means that none
    predicts left-out recordings.
    """
    recordings = [one for one in data.recordings if isinstance(one, Series)]
    if len(data.experiments) < MIN_RECORDINGS:
        return None
    variables = _variables(recordings[0], units)
    features, channels = list(_features(variables)), recordings[0].quantities
    values = [_values(one, v, variables) for one, v in zip(recordings, nominal.residuals, strict=True)]
    largest = np.max([np.abs(one).max(axis=1) for one in values], axis=0)  # the same of all recordings
    every = [
        _products(data, nominal, k, list(_evaluated(own, np.where(largest > 0.0, largest, 1.0))))
        for k, own in enumerate(values)
    ]
    labels = [
        Label(f"{f.formula} in {c.name}", f"{c.name} differs by a multiple of {f.words}", _over(c.unit, f.unit))
        for c in channels
        for f in features
    ]
    count = [float(part.stop - part.start) for part in data.recording_slices]
    sums = NormalEquations.of(  # repeats of an experiment do not predict each other
        np.array([sum(every[r] for r in group) for group in data.experiments]),
        len(labels),
        np.array([sum(count[r] for r in group) for group in data.experiments]),
        PRIOR_SD,
    )
    return selected_law(sums, labels, "of motion and inputs")


def _variables(recording: Series, units: Mapping[str, str]) -> list[_Variable]:
    channels = [_Variable(one.name, one.name, one.unit) for one in recording.quantities]
    rates = [_Variable(f"d({one.name})/dt", f"the rate of {one.name}", _over(one.unit, "s")) for one in channels]
    inputs = [_Variable(name, f"the input {name}", units.get(name, "1")) for name in recording.inputs]
    return [*channels, *inputs, *rates][:MOST_VARIABLES]


def _values(recording: Series, residual: Float[Array, "T C"], variables: list[_Variable]) -> Float[Array, "V T"]:
    """Return the variables as the model simulates them, at the samples of ``recording``."""
    simulated = np.stack([_filled(recording.times, column) for column in (recording.values + residual).T])
    rates = np.gradient(simulated, recording.times, axis=1)
    return np.concatenate([simulated, *[one[None] for one in recording.inputs.values()], rates])[: len(variables)]


def _filled(times: Float[Array, " T"], values: Float[Array, " T"]) -> Float[Array, " T"]:
    """Return ``values``, where they are NaN interpolated; zero if all are."""
    seen = np.isfinite(values)
    return np.asarray(np.interp(times, times[seen], values[seen])) if seen.any() else np.zeros(len(times))


def _features(variables: list[_Variable]) -> Iterator[_Feature]:
    """Yield the functions of the variables, in the order of :func:`_evaluated`."""
    for one in variables:
        name, words, unit = one
        yield _Feature(name, words, unit)
        yield _Feature(f"sign({name})", f"the sign of {words}", "1")
        yield _Feature(f"({name})^2", f"the square of {words}", _power(unit, 2))
        yield _Feature(f"|{name}| {name}", f"{words} times its size", _power(unit, 2))
        yield _Feature(f"({name})^3", f"the cube of {words}", _power(unit, 3))
    for one, other in combinations(variables, 2):
        yield _Feature(f"{one.name} {other.name}", f"{one.words} times {other.words}", _times(one.unit, other.unit))


def _evaluated(values: Float[Array, "V T"], largest: Float[Array, " V"]) -> Iterator[Float[Array, " T"]]:
    """Yield the values [T] of each function; ``largest`` [V]: of each variable, by which signs are smoothed."""
    for one, most in zip(values, largest, strict=True):
        yield one
        yield np.tanh(one / (SMOOTH * most))
        yield one**2
        yield np.abs(one) * one
        yield one**3
    for one, other in combinations(values, 2):
        yield one * other


def _products(data: WhitenedData, nominal: Fit, recording: int, features: list[Array]) -> Array:
    """Return all inner products of the columns of a recording: terms, derivatives by the genes, and what is missing.

    A term is one of the ``features`` in one channel.
    """
    record, fit, part = data.recordings[recording], data.reduced[recording], data.recording_slices[recording]
    if not (isinstance(record, Series) and isinstance(fit, SeriesFit)):
        raise TypeError("only series have such a law")
    terms = list[Array]()
    for channel in range(len(record.quantities)):
        shown = np.zeros((len(features), *record.values.shape))
        shown[:, :, channel] = np.where(record.valid[:, channel], np.array(features), np.nan)
        terms.append(fit.of(shown)[:, fit.used].reshape(len(features), -1))
    columns = np.concatenate([*terms, nominal.jacobian[part].T, -nominal.coefficients[None, part]]) / data.scale[part]
    return np.asarray(columns @ columns.T)


def _power(unit: str, exponent: int) -> str:
    return unit if unit == "1" else f"({unit})^{exponent}" if set(unit) & set(" /*^") else f"{unit}^{exponent}"


def _times(one: str, other: str) -> str:
    return other if one == "1" else one if other == "1" else f"{one} {other}"


def _over(unit: str, by: str) -> str:
    return unit if by == "1" else f"{unit}/{_bracketed(by)}"


def _bracketed(unit: str) -> str:
    return f"({unit})" if set(unit) & set(" /*") else unit
