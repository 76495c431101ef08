"""Describe where the nominal model differs from the recordings, in numbers and as text."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wingfit.diagnosis.evidence.intervals import standard_errors
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.finding import Exponent, Interval, Where
from wingfit.diagnosis.location.maps import PHASES, RecordingResidual, harmonics
from wingfit.records import Condition
from wingfit.records.array_types import Array, Float
from wingfit.sim.atmosphere import density

EXTENT_QUANTILES = (0.05, 0.95)  # of the excess: ends of the reported extent
MIN_PHASE_CONCENTRATION = 0.35  # length of the mean phase vector from which a misfit has a phase
WHOLE_EXTENT = 0.8  # of the span or chord: a misfit that extends over as much has no location
MIN_RATIO = 1.05  # of two values of a variable that differ


def residual_location(
    data: WhitenedData, residuals: Sequence[RecordingResidual], coefficients: Float[Array, " D"]
) -> Where:
    """Return where and when a residual (``coefficients`` [D], by recording ``residuals``) lies, and how it scales."""
    spread = harmonics(data, coefficients)
    span, chord = (_extent_along(residuals, name) for name in ("span", "chord"))
    phase, axis = _phase(residuals), _axis(residuals)
    exponents = _exponents(data, coefficients)
    words = _sentence(span, chord, phase, axis, spread, exponents)
    return Where(words, span, chord, phase, axis, spread, exponents)


def _extent_along(residuals: Sequence[RecordingResidual], name: str) -> Interval | None:
    """Return median and extent of the misfit along ``name``, "span" or "chord"; None for forces or without misfit."""
    at, mass = [], []
    for residual in residuals:
        for place, one in zip(residual.locations, residual.excess, strict=True):
            value = getattr(place, name)
            if value is None:
                return None
            at.append(value)
            mass.append(one)
    positions, which = np.unique(at, return_inverse=True)
    weight = np.bincount(which, weights=mass)
    if weight.sum() <= 0:
        return None
    total = np.concatenate([[0.0], np.cumsum(weight)]) / weight.sum()
    low, middle, high = (
        float(np.interp(part, total, _cell_edges(positions)))
        for part in (EXTENT_QUANTILES[0], 0.5, EXTENT_QUANTILES[1])
    )
    return Interval(middle, low, high)


def _cell_edges(positions: Array) -> Array:
    """Return the edges [n + 1] of the parts of the span or chord that markers at sorted ``positions`` [n] represent."""
    if len(positions) < 2:
        return np.repeat(positions, 2)
    half = 0.5 * (positions[1:] + positions[:-1])
    ends = np.clip([2 * positions[0] - half[0], 2 * positions[-1] - half[-1]], 0.0, 1.0)
    return np.array([min(ends[0], positions[0]), *half, max(ends[1], positions[-1])])


def _phase(residuals: Sequence[RecordingResidual]) -> Interval | None:
    """Return centre and extent of the misfit in the beat; None where it is spread over the whole beat.

    The centre is that of the misfit above half of its maximum, because a fit spreads a misfit over the beat.
    """
    mass = np.sum([(residual.beat**2).mean(axis=1) for residual in residuals], axis=0)
    peak = np.where(mass > 0.5 * mass.max(), mass, 0.0)
    mass = np.maximum(mass - mass.min(), 0.0)
    if mass.sum() <= 0:
        return None
    turn = np.exp(2j * np.pi * np.arange(PHASES) / PHASES)
    if abs(complex((mass * turn).sum() / mass.sum())) < MIN_PHASE_CONCENTRATION:
        return None
    mean = complex((peak * turn).sum())
    middle = float(np.angle(mean) / (2 * np.pi)) % 1.0
    start = round(middle * PHASES) - PHASES // 2
    rolled = np.roll(mass, -start)
    total = (np.cumsum(rolled) - 0.5 * rolled) / rolled.sum()
    low, high = (float(np.interp(part, total, np.arange(PHASES))) + start for part in EXTENT_QUANTILES)
    return Interval(middle, low / PHASES, high / PHASES)


def _axis(residuals: Sequence[RecordingResidual]) -> str:
    totals = dict.fromkeys("xyz", 0.0)
    for residual in residuals:
        for place, one in zip(residual.locations, residual.excess, strict=True):
            totals[place.axis] += float(one)
    return max(totals, key=lambda axis: totals[axis])


def _exponents(data: WhitenedData, coefficients: Array) -> tuple[Exponent, ...]:
    """Return the exponent with which the misfit scales with each variable that differs between the recordings."""
    excess = data.excess_by_recording(coefficients)
    level = 0.02 * max(float(excess.max()), 0.0)
    if len(excess) < 3 or level <= 0.0:
        return ()
    size = 0.5 * np.log(np.maximum(excess, level))
    variables = [
        v for v in _variables([r.condition for r in data.beat_recordings]) if v[3].max() > MIN_RATIO * v[3].min()
    ]
    while variables:
        design = np.stack([np.ones(len(size)), *(np.log(v[3]) for v in variables)], axis=1)
        scaled = design[:, 1:] - design[:, 1:].mean(axis=0)
        power = np.linalg.svd(scaled / np.maximum(np.linalg.norm(scaled, axis=0), 1e-12), compute_uv=False)
        if len(size) > design.shape[1] and power[-1] > 0.2:
            break
        variables.pop()
    if not variables:
        return ()
    best, *_ = np.linalg.lstsq(design, size, rcond=None)
    remainder, freedom = size - design @ best, len(size) - design.shape[1]
    cover = np.linalg.inv(design.T @ design) * max(float(remainder @ remainder) / freedom, 0.05**2)
    errors = standard_errors(freedom) * np.sqrt(np.diag(cover))
    return tuple(
        Exponent(name, Interval(float(b), float(b - d), float(b + d)), *ends, unit)
        for (name, unit, ends, _), b, d in zip(variables, best[1:], errors[1:], strict=True)
    )


def _variables(conditions: Sequence[Condition]) -> list[tuple[str, str, tuple[float, float], Array]]:
    """Return name, unit, range and values of each variable that is positive under all conditions."""
    every = (
        ("flap frequency", "Hz", [c.flap_frequency for c in conditions]),
        ("air density", "kg/m^3", [density(c.pressure, c.temperature) for c in conditions]),
        ("airspeed", "m/s", [c.airspeed for c in conditions]),
    )
    return [(name, unit, (min(v), max(v)), np.array(v, float)) for name, unit, v in every if min(v) > 0]


def _sentence(
    span: Interval | None,
    chord: Interval | None,
    phase: Interval | None,
    axis: str,
    spread: Sequence[float],
    exponents: Sequence[Exponent],
) -> str:
    place = _span_text(span, chord)
    when = "over the whole beat"
    if phase is not None:
        when = f"from {(phase.low or 0.0) % 1.0:.2f} to {(phase.high or 0.0) % 1.0:.2f} of the beat"
    largest = int(np.argmax(spread))
    line = "a constant offset" if largest == 0 else f"mostly at {largest} per beat"
    grows = [_scaling_text(one) for one in exponents]
    scaling = f"; {', '.join(g for g in grows if g)}" if any(grows) else ""
    return f"{place}, {when}, along {axis}, {line}{scaling}"


def cause_location(
    span: Interval | None, chord: Interval | None, phase: Interval | None, *, drive_error: bool = False
) -> str:
    """Return where the cause of a misfit acts, as text to append to the location of the misfit; "" where not known.

    ``drive_error``: the cause is an error of the drive rods.
    """
    parts = [
        f"{100 * one.value:.0f} % of the {name}{_range_text(one, 100, 0, ' %')}"
        for name, one in (("span", span), ("chord", chord))
        if one is not None
    ]
    if phase is not None:
        parts.append(f"{phase.value % 1.0:.2f} of the beat{_range_text(phase, 1, 2, '', -(phase.value // 1.0))}")
    if drive_error:
        return "; its cause is an error of the drive's motion" + (f", largest at {parts[-1]}" if phase else "")
    return f"; its cause acts at {', '.join(parts)}" if parts else ""


def _range_text(one: Interval, factor: float, digits: int, unit: str, shift: float = 0.0) -> str:
    if one.low is None or one.high is None:
        return ""
    return f" ({factor * one.low + shift:.{digits}f} to {factor * one.high + shift:.{digits}f}{unit})"


def _span_text(span: Interval | None, chord: Interval | None) -> str:
    if span is None or span.low is None or span.high is None:
        return "in the forces"
    low, high = span.low, span.high
    if high - low >= WHOLE_EXTENT:
        words = "over the whole span"
    elif high > 0.9:
        words = f"outer {100 * (1 - low):.0f} % of the span"
    elif low < 0.1:
        words = f"inner {100 * high:.0f} % of the span"
    else:
        words = f"between {100 * low:.0f} and {100 * high:.0f} % of the span"
    if chord and chord.low is not None and chord.high is not None and chord.high - chord.low < WHOLE_EXTENT:
        side = "front" if chord.value < 0.4 else "rear" if chord.value > 0.6 else "middle"
        words += f", {side} of the chord"
    return words


def _scaling_text(one: Exponent) -> str:
    low, high, power = one.power.low, one.power.high, one.power.value
    if low is None or high is None or high - low > 2.0:
        return ""
    if low <= 0.0 <= high:
        return f"independent of {one.variable}" if high - low < 1.0 else ""
    name = {1: f"{one.variable}", 2: f"{one.variable} squared"}.get(round(power), f"{one.variable}^{power:.1f}")
    if power > 0.5:
        return f"grows with {name}"
    return f"grows slowly with {one.variable}" if power > 0 else f"falls with {one.variable}"
