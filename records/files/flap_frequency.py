"""Checks the stated flap frequency of a recording against the frequency at which its samples repeat."""

from __future__ import annotations

import numpy as np

from wingfit.records.array_types import Array, Float, Index
from wingfit.records.dataset import Recording
from wingfit.records.errors import Faults

HARMONICS = 4  # of the flap frequency that are fitted
LEAST_BEATS = 3.0  # with fewer, close frequencies look alike
SAMPLES_PER_BEAT = 2 * HARMONICS + 4  # with fewer, harmonics are aliased
RANGE = 1.6  # frequencies from the stated one divided by this to the stated one times this are tried, and half of it
COLUMNS, ROWS = 12, 3000  # most that are used
WRONG = 0.2  # fraction of the variance that the harmonics of a wrong frequency leave at least
RIGHT = 0.1  # of what they leave, what those of the right frequency leave at most
GAPS = 0.2  # fraction of a column that may be missing


def check_frequency(recording: Recording, where: str, faults: Faults) -> None:
    """Add a fault if the samples of ``recording`` clearly repeat at another frequency than the stated one."""
    found = other_frequency(recording)
    if found is None:
        return
    stated, (frequency, left, before) = recording.condition.flap_frequency, found
    message = (
        f"flap_frequency_hz is {stated:g} Hz, but the samples repeat at {frequency:.4g} Hz: its harmonics leave "
        f"{100 * left:.2g} % of their variance, those of {stated:g} Hz {100 * before:.2g} %; correct flap_frequency_hz "
        "or time_s"
    )
    faults.add(where, stated, message)


def other_frequency(recording: Recording) -> tuple[float, float, float] | None:
    """Return the frequency (Hz) at which the samples repeat if it is clearly not the stated one, else None.

    Also the fractions of the variance that its harmonics and those of the stated frequency do not explain.
    """
    times, stated = recording.times, recording.condition.flap_frequency
    signals = _signals(recording)
    if signals is None:
        return None
    times, values = times[signals[0]], signals[1]
    span = float(times[-1] - times[0])
    before = _left(times, values, stated)
    if before < WRONG:
        return None
    half = 0.5 * stated
    if half * span >= LEAST_BEATS and (left := _left(times, values, half)) < RIGHT * before:
        return half, left, before
    tried = np.arange(stated / RANGE, stated * RANGE, 0.25 / span)
    left_by = np.array([_left(times, values, f) for f in tried])
    best = int(np.argmin(left_by))
    near = np.linspace(tried[best] - 0.25 / span, tried[best] + 0.25 / span, 21)
    finer = np.array([_left(times, values, f) for f in near])
    frequency, left = float(near[np.argmin(finer)]), float(finer.min())
    return (frequency, left, before) if left < RIGHT * before else None


def _signals(recording: Recording) -> tuple[Index, Float[Array, "T C"]] | None:
    """Return indices of rows and their values [T, C] in the columns that vary most; None if the check is impossible."""
    times, values = recording.times, recording.values
    stated = recording.condition.flap_frequency
    if len(times) < SAMPLES_PER_BEAT or stated * float(times[-1] - times[0]) < LEAST_BEATS:
        return None
    step = float(np.median(np.diff(times)))
    if step <= 0.0 or step * stated * SAMPLES_PER_BEAT > 1.0:
        return None
    every = max(1, min(len(times) // ROWS, int(1.0 / (step * stated * SAMPLES_PER_BEAT))))
    part = values[::every]
    full = np.isfinite(part).mean(axis=0) >= 1.0 - GAPS
    if not full.any():
        return None
    columns = np.flatnonzero(full)
    spread = np.nanstd(part[:, columns], axis=0)
    chosen = columns[np.argsort(-spread, kind="stable")[:COLUMNS]]
    rows = np.flatnonzero(np.isfinite(part[:, chosen]).all(axis=1))
    if len(rows) < SAMPLES_PER_BEAT * LEAST_BEATS:
        return None
    return rows * every, part[np.ix_(rows, chosen)]


def _left(times: Array, values: Array, frequency: float) -> float:
    """Return the fraction of the variance of ``values`` [T, C] that harmonics of ``frequency`` and a trend leave."""
    turn = 2.0 * np.pi * frequency * times[:, None] * np.arange(1, HARMONICS + 1)
    at = times - times.mean()
    design = np.column_stack([np.ones_like(at), at / np.abs(at).max(), np.cos(turn), np.sin(turn)])
    basis, _ = np.linalg.qr(design)
    about = values - basis[:, :2] @ (basis[:, :2].T @ values)
    total = float(np.sum(about**2))
    rest = float(np.sum((about - basis @ (basis.T @ about)) ** 2))
    return rest / total if total > 0.0 else 0.0
