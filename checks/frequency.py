"""The flap frequency and the unit of time, against the frequency at which the samples repeat."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wingfit.checks.harmonics import design
from wingfit.checks.mistake import Edit, KeyEdit, Mistake, TableEdit, change_of
from wingfit.records import Recording
from wingfit.records.array_types import Array, Float

HARMONICS = 4
COLUMNS, ROWS = 4, 500  # most that are used
GAPS = 0.35  # fraction of a column that may be missing
LEAST_BEATS = 1.5  # with fewer, close frequencies look alike
MOST_BEATS = 2000.0  # with more, near frequencies are too many to try, and clocks drift apart
NEAR = 1.6  # frequencies from the stated one divided by this to that times this are tried
STEP = 0.2  # beats by which neighbouring trial frequencies differ over the recording
# Of the variance, what the stated frequency leaves at least, and of this what the right one leaves at most: a warning,
# and a refusal. Drift, noise and play are left by both.
DOUBTFUL, DOUBTFULLY = 0.004, 0.35
REFUSED, REFUSABLY = 0.02, 0.12
# Samples whose phase is seen in another beat, too, for a warning and a refusal: with fewer, nothing seems to repeat.
OVERLAP, CERTAIN_OVERLAP = 0.5, 0.75
SLIP = 0.06  # beats over the recording: smaller differences of frequencies are not remarked on
APART = 0.004  # relative difference that is not remarked on: clocks of cameras and motors
ABSENT = 1e-3  # of the variance, what odd harmonics hold where the motion has twice the stated frequency
ONE_A_BEAT = 0.6  # samples in a beat: a strobe takes one; with fewer, the unit of time or the frequency is wrong
FEW_BEATS, MANY_BEATS = 2.2, 50.0  # in a recording; between two frames
STROBE = 3.0  # with fewer samples in a beat, other frequencies give the same samples
RATIOS = (
    (1e-3, "time", "time_s is in milliseconds", 1e-3),
    (1e-6, "time", "time_s is in microseconds", 1e-6),
    (60.0, "time", "time_s is in minutes", 60.0),
    (1 / (2 * np.pi), "frequency", "the frequency is in rad/s (2 pi times as large)", None),
    (2 * np.pi, "frequency", "the frequency was divided by 2 pi", None),
    (1 / 60.0, "frequency", "the frequency is in beats per minute", None),
    (2.0, "frequency", "the frequency is that of whole cycles of two beats, or half as large by mistake", None),
    (0.5, "frequency", "strokes (half beats) were counted in place of beats", None),
    (1e-2, "time", "time_s is in hundredths of a second", 1e-2),
)


class Repeat(NamedTuple):
    """A frequency (Hz), and the fraction of the variance that its harmonics do not explain."""

    frequency: float
    left: float


def check_frequency(recording: Recording, index: int) -> Mistake | None:
    """Return the mistake if the samples clearly repeat at another frequency than the stated one.

    ``index``: place of the recording in ``dataset.yaml``.
    """
    signals = _signals(recording)
    if signals is None:
        return None
    times, values = signals
    stated = recording.condition.flap_frequency
    given = Repeat(stated, left(times, values, stated))
    samples = 1.0 / (stated * float(np.median(np.diff(recording.times))))
    if (found := _counted_frames(recording, times, values, given)) is not None:
        return found
    ratios = _by_ratio(recording, index, times, values, given)
    strobe = recording.kind == "tracks" and ONE_A_BEAT <= samples < STROBE
    # Where frames are many beats apart, any frequency has an alias nearby.
    near = [] if ratios and samples < STROBE and not strobe else _by_scan(recording, index, times, values, given)
    if near and strobe:
        return near[0].mistake
    tried = [*near, *ratios]
    step = float(np.median(np.diff(recording.times)))
    tried = [one for one in tried if one.repeat.frequency * step < 0.5] or tried
    if not tried:
        return None
    least = min(one.repeat.left for one in tried)
    # What repeats in one beat also repeats in several.
    return max(
        (one for one in tried if one.repeat.left <= 1.5 * least + 2e-3), key=lambda one: one.repeat.frequency
    ).mistake


class Candidate(NamedTuple):
    """A frequency at which the samples repeat better than at the stated one, and the mistake that it would show."""

    repeat: Repeat
    mistake: Mistake


def _by_scan(recording: Recording, index: int, times: Array, values: Array, given: Repeat) -> list[Candidate]:
    """Return the best frequency near the stated one, if it is clearly better."""
    stated, length = given.frequency, float(np.ptp(times))
    if given.left < DOUBTFUL or not LEAST_BEATS <= stated * length <= MOST_BEATS:
        return []
    best = _near(times, values, stated)
    apart = abs(best.frequency - stated) * length >= SLIP and abs(best.frequency / stated - 1) >= APART
    if not apart or best.left > DOUBTFULLY * given.left:
        return []
    overlap = _overlap(times, best.frequency)
    if overlap < OVERLAP:
        return []
    certain = given.left > REFUSED and best.left < REFUSABLY * given.left and overlap >= CERTAIN_OVERLAP
    samples = 1.0 / (stated * float(np.median(np.diff(recording.times))))
    strobe = recording.kind == "tracks" and samples < STROBE
    return [Candidate(best, _other(recording, index, given, best, strobe=strobe, certain=certain))]


def left(times: Float[Array, " T"], values: Float[Array, "T C"], frequency: float) -> float:
    """Return the fraction of the variance of ``values`` that harmonics of ``frequency`` (Hz) do not explain."""
    basis, _ = np.linalg.qr(design(times - times[0], frequency, HARMONICS))
    about = values - values.mean(axis=0)
    total = float((about**2).sum())
    explained = float(((basis.T @ values) ** 2).sum()) - len(values) * float((values.mean(axis=0) ** 2).sum())
    return max(0.0, 1.0 - explained / total) if total > 0 else 0.0


def _near(times: Array, values: Array, stated: float) -> Repeat:
    """Return the frequency within NEAR of ``stated`` whose harmonics leave least."""
    length = float(np.ptp(times))
    best = _refined(times, values, np.arange(stated / NEAR, stated * NEAR, STEP / length), STEP / length)
    # What repeats in one beat also repeats in two.
    double = Repeat(2 * best.frequency, left(times, values, 2 * best.frequency))
    return double if double.left < 1.5 * best.left + 1e-3 else best


def _refined(times: Array, values: Array, tried: Array, step: float) -> Repeat:
    best = float(tried[int(np.argmin([left(times, values, one) for one in tried]))])
    for _ in range(2):
        near = np.linspace(best - step, best + step, 17)
        lefts = [left(times, values, one) for one in near]
        best, step = float(near[int(np.argmin(lefts))]), step / 6
    return Repeat(best, left(times, values, best))


def _by_ratio(recording: Recording, index: int, times: Array, values: Array, given: Repeat) -> list[Candidate]:
    """The usual factors between a stated and the right frequency, or between units of time."""
    found = list[Candidate]()
    length, step = float(np.ptp(times)), float(np.median(np.diff(recording.times)))
    for ratio, what, cause, factor in RATIOS:
        wanted = given.frequency * ratio
        usual = REFUSABLY if recording.kind == "tracks" else DOUBTFULLY
        limit = max(2.0 * given.left, 0.02) if ratio == 2.0 else usual * given.left
        if wanted * length < 0.9 or wanted * step * ONE_A_BEAT > 1.0:
            continue
        if ratio == 2.0:
            # Along one axis, the strokes forth and back of a wing may well have the same force.
            alike = recording.kind == "forces" and values.shape[1] < 2
            if alike or not _only_even(times, values, given):
                continue
        elif ratio == 60.0 and given.frequency * length < FEW_BEATS:
            # Of next to no beat, any harmonics explain all; and any samples, if a frame is taken in about each beat.
            # Harmonics beyond half the sampling rate are others in disguise, those of the stated beat among them.
            seen = wanted * step * HARMONICS < 0.5
            limit = 0.15 if given.frequency * length < 1.0 or seen else limit
        elif ratio == 1e-3 and given.frequency * step > MANY_BEATS:
            limit = max(limit, 1.5 * given.left)
        elif given.left < (REFUSED if ratio == 0.5 else 0.2):
            continue
        width = min(0.04 * wanted, 4.0 / length)
        best = _refined(times, values, np.linspace(wanted - width, wanted + width, 33), width / 16)
        if best.left > limit:
            continue
        if what == "time" and factor is not None:
            found.append(Candidate(best, _time_unit(recording, given, best, cause, factor)))
            continue
        certain = recording.kind == "tracks" and (ratio != 0.5 or _slow(times, values, best.frequency))
        certain &= _overlap(times, best.frequency) >= CERTAIN_OVERLAP
        exact = Repeat(best.frequency if abs(best.frequency / wanted - 1) > 0.01 else wanted, best.left)
        wrong = _other(recording, index, given, exact, strobe=False, certain=certain, cause=cause)
        found.append(Candidate(best, wrong))
    return found


def _overlap(times: Float[Array, " T"], frequency: float) -> float:
    """Return the fraction of samples near whose phase there is a sample of another beat of ``frequency`` (Hz).

    Harmonics explain any motion whose phases are seen once: that of a bird that turns, in little more than a beat.
    """
    beats = (times - times[0]) * frequency
    apart = beats[:, None] - beats[None, :]
    other = np.abs(np.round(apart)) >= 1
    near = np.abs(apart - np.round(apart)) < 1 / (4 * HARMONICS)
    return float((other & near).any(axis=1).mean())


def _only_even(times: Array, values: Array, given: Repeat) -> bool:
    """Whether the odd harmonics of the stated frequency are absent, and the second is there."""
    if given.frequency * np.ptp(times) < 0.9 or len(times) < 3 * (4 * HARMONICS + 1) or given.left > 0.4:
        return False
    waves = np.linalg.lstsq(design(times, given.frequency, 2 * HARMONICS), values, rcond=None)[0]
    power = (waves[1::2] ** 2 + waves[2::2] ** 2).sum(axis=1)
    rest = max(2.0 * values.shape[1] - power.sum(), 0.0)  # of values of unit variance
    noise = 2.0 * rest / len(times)
    odd = power[::2].sum()
    return bool(odd < max(ABSENT * power[1], 12 * noise) and power[1] > 0.3 * power.sum() and rest < 0.5 * power.sum())


def _slow(times: Array, values: Array, frequency: float) -> bool:
    """Whether the first harmonic of ``frequency`` is larger than the second: no motion that repeats after two beats."""
    waves = np.linalg.lstsq(design(times, frequency, HARMONICS), values, rcond=None)[0]
    power = (waves[1::2] ** 2 + waves[2::2] ** 2).sum(axis=1)
    return bool(power[0] > 3.0 * power[1])


def _time_unit(recording: Recording, given: Repeat, best: Repeat, cause: str, factor: float) -> Mistake:
    edit = TableEdit(
        recording.name, "column time_s", cause.removeprefix("time_s is in "), f"seconds (times {factor:g})",
        lambda times, values, _: (times * factor, values),
    )  # fmt: skip
    return Mistake(
        "time unit",
        f"recording {recording.name!r}: time_s",
        f"the samples repeat at {best.frequency:.4g} Hz by time_s, flap_frequency_hz is {given.frequency:.4g}",
        f"samples that repeat at {given.frequency:.4g} Hz",
        cause,
        change_of([edit]),
        True,
        (edit,),
    )


def _other(
    recording: Recording, index: int, given: Repeat, best: Repeat, *, strobe: bool, certain: bool, cause: str = ""
) -> Mistake:
    edits: tuple[Edit, ...] = ()
    if not strobe:
        edits = (
            KeyEdit(("recordings", index, "flap_frequency_hz"), f"{given.frequency:.9g}", f"{best.frequency:.6g}"),
        )
    also = " (with a strobe, other frequencies give the same samples)" if strobe else ""
    return Mistake(
        "frequency",
        f"recording {recording.name!r}: flap_frequency_hz",
        f"is {given.frequency:.6g} Hz, whose harmonics leave {100 * given.left:.2g} % of the variance",
        f"{best.frequency:.5g} Hz, whose harmonics leave {100 * best.left:.2g} %{also}",
        cause or "the stated frequency is a set value, not the measured one; or the frame rate behind time_s is wrong",
        change_of(edits) if edits else f"dataset.yaml, recordings[{index}].flap_frequency_hz, or time_s",
        certain,
        edits,
    )


def _counted_frames(recording: Recording, times: Array, values: Array, given: Repeat) -> Mistake | None:
    """Times that are numbers of frames: equal steps of one, and samples that repeat at some other frequency."""
    steps = np.diff(recording.times)
    if given.left < 0.2 or not np.allclose(steps, 1.0, atol=1e-9):
        return None
    length = float(np.ptp(times))
    best = _refined(times, values, np.arange(1.5 / length, 0.45, STEP / length), STEP / length)
    if best.left > REFUSABLY * given.left:
        return None
    rate = given.frequency / best.frequency
    return Mistake(
        "time unit",
        f"recording {recording.name!r}: time_s",
        f"increases by 1 in each row, and the samples repeat every {1 / best.frequency:.4g} rows",
        f"steps of about {1 / rate:.4g} s, so that they repeat at {given.frequency:.4g} Hz",
        "time_s holds numbers of frames",
        f"recordings/{recording.name}.csv, column time_s: frame number -> frame number / frame rate "
        f"(about {rate:.4g} Hz)",
        True,
    )


def _signals(recording: Recording) -> tuple[Array, Array] | None:
    """Return times [T] and values [T, C] of the columns that vary most, scaled to unit variance; None if too few."""
    times, values = recording.times, recording.values
    if len(times) > ROWS:
        step = float(np.median(np.diff(times)))
        beat = 1.0 / (recording.condition.flap_frequency * step) if step > 0 else 0.0
        every = max(1, min(len(times) // ROWS, int(beat / (4 * HARMONICS))))
        times, values = times[::every][:ROWS], values[::every][:ROWS]
    full = np.isfinite(values).mean(axis=0) >= 1.0 - GAPS
    if not full.any() or np.ptp(times) <= 0:
        return None
    columns = np.flatnonzero(full)
    spread = np.nanstd(values[:, columns], axis=0)
    order = columns[np.argsort(-spread, kind="stable")[:COLUMNS]]
    for count in range(len(order), 0, -1):
        rows = np.isfinite(values[:, order[:count]]).all(axis=1)
        if rows.mean() > 0.6 and rows.sum() >= 3 * (2 * HARMONICS + 1):
            chosen = values[np.ix_(np.flatnonzero(rows), order[:count])]
            deviation = chosen.std(axis=0)
            return (times[rows], chosen[:, deviation > 0] / deviation[deviation > 0]) if deviation.any() else None
    return None
