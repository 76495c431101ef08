"""Times of the frames, from a rate, from a column of times, or from both, which must agree."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from wingfit.importers.limits import MAX_RATE, MIN_RATE
from wingfit.importers.options import TIME_UNITS, Given, ask, question
from wingfit.importers.raw import Raw, Stated
from wingfit.importers.repeats import repeated
from wingfit.importers.tracks import Statement
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import DatasetError, Faults, counted, fail

_SAME_RATE = 1e-4  # relative: "119.88" and 119.8801 are the same rate, 119.88 and 120 are not
_MOST_DECIMALS = 9
_ROUNDING = 0.51  # of the last decimal of a printed time
_FURTHEST = 0.3  # frame intervals between a printed time and its frame; beyond, it may belong to the next frame
_LISTED = 12  # recordings of a file that an error names
_DRIFT = 1e-6  # relative: of times that a program computed in single precision


@dataclass
class Timing:
    """Times [T], s, with who stated what about them."""

    times: Float[Array, " T"]
    statements: list[Statement]
    remarks: list[str] = field(default_factory=list)


def resolve_times(raw: Raw, given: Given, file: str, faults: Faults) -> Timing | None:
    """Return the times of the frames; add a fault, and return None, for what is missing or contradicts the file.

    With a rate and a column of times that agree within the rounding of the printed times, the times are multiples of
    the frame interval from the first printed time on, as printed times may be rounded to a millisecond.
    """
    _check_frames(raw, file)
    rate = _rate(raw, given, file, faults)
    if raw.times is None:
        return _from_rate(raw, rate, given, file, faults)
    unit = _time_unit(raw, given, file, faults)
    if unit is None:
        _check_times(raw.times, raw, file, "")
        return None
    numerator, denominator = TIME_UNITS[unit.value]
    printed = raw.times * numerator / denominator
    stated = Statement("times", f"in {unit.value}", unit.by, unit.where if unit.by == "user" else raw.times_where)
    if rate is not None:
        return _from_both(raw, printed, stated, rate, given, file, faults)
    if faults.faults and raw.rates:
        return None
    _check_times(printed, raw, file)
    steps = np.diff(printed)
    _check_steps(steps, raw, file)
    uneven = steps.max() - steps.min() > 2 * _resolution(printed) + _DRIFT * float(np.abs(printed).max())
    spread = f"times are not evenly spaced: {1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms apart"
    return Timing(printed, [stated], [spread] if uneven else [])


def _check_frames(raw: Raw, file: str) -> None:
    if raw.frames is None or len(raw.frames) < 2:
        return
    steps = np.diff(raw.frames)
    if (steps <= 0).any():
        at = int(np.flatnonzero(steps <= 0)[0]) + 1
        what = "repeats the number of the line above" if steps[at - 1] == 0 else f"follows {raw.frames[at - 1]}"
        message = f"frame {raw.frames[at]} {what}; numbers of frames must increase: sort the rows, remove repeats"
        if choices := raw.row_choices(raw.frames):
            message += f", or choose those of one recording: {_choices(choices)}"
            where = f"{file}, {raw.line_word} {raw.lines[at]}"
            raise ask("rows", where, int(raw.frames[at]), message, choices)
        if (steps >= 0).all():
            raise repeated(raw, raw.frames, file)
        raise fail(f"{file}, {raw.line_word} {raw.lines[at]}", int(raw.frames[at]), message)


def _rate(raw: Raw, given: Given, file: str, faults: Faults) -> Statement | None:
    """Return the rate (Hz) and who stated it, or None; add a fault if statements contradict each other."""
    for stated in raw.rates:
        if not MIN_RATE <= stated.value <= MAX_RATE:
            limits = f"it must lie in [{MIN_RATE:g}, {MAX_RATE:g}] Hz"
            raise fail(f"{file}, {stated.where}", stated.value, f"is {stated.value:g} Hz; {limits}: export it again")
    if given.rate_hz is not None:
        agreeing = [one for one in raw.rates if _same(one.value, given.rate_hz)]
        if raw.rates and not agreeing and raw.times is None:
            faults.add("--rate-hz", given.rate_hz, _contradicts(given.rate_hz, file, raw.rates))
            return None
        chosen = agreeing[0] if agreeing else None
        if chosen:
            return Statement("rate", f"{chosen.value:.9g} Hz", "file", chosen.where)
        return Statement("rate", f"{given.rate_hz:.9g} Hz", "user", "--rate-hz")
    if not raw.rates:
        return None
    if not all(_same(one.value, raw.rates[0].value) for one in raw.rates):
        listed = ", ".join(f"{one.where}: {one.value:g} Hz" for one in raw.rates)
        message = f"states different rates ({listed}); say which is right: --rate-hz"
        faults.put(question("rate_hz", file, listed, message, [f"{one.value:.9g}" for one in raw.rates]))
        return None
    return Statement("rate", f"{raw.rates[0].value:.9g} Hz", "file", raw.rates[0].where)


def _contradicts(rate: float, file: str, rates: list[Stated[float]]) -> str:
    listed = ", ".join(f"{one.value:g} Hz ({one.where})" for one in rates)
    return f"is {rate:g} Hz, but {file} states {listed}; leave it out, or correct the file"


def _same(a: float, b: float) -> bool:
    return abs(a - b) <= _SAME_RATE * abs(b)


def _value(rate: Statement, raw: Raw, given: Given) -> float:
    """Return the rate in full precision; its statement has a rounded text."""
    if rate.by == "user" and given.rate_hz is not None:
        return given.rate_hz
    return next(one.value for one in raw.rates if one.where == rate.where)


def _from_rate(raw: Raw, rate: Statement | None, given: Given, file: str, faults: Faults) -> Timing | None:
    if rate is None:
        if not raw.rates:
            hint = f" ({raw.rate_hint})" if raw.rate_hint else ""
            message = f"states neither a rate nor times{hint}; add the {raw.row_word} per second: --rate-hz 500"
            faults.put(question("rate_hz", file, None, message, hint=raw.rate_hint))
        return None
    hertz = _value(rate, raw, given)
    numbers = np.arange(len(raw.positions))
    statements, remarks = [rate], []
    if raw.frames is not None:
        start = int(raw.frames[0])
        numbers = raw.frames - min(raw.first, start)  # some programs count from 0, where others count from 1
        statements.append(Statement("first frame", str(start), "file", "numbers of frames"))
        missing = int(raw.frames[-1]) - start + 1 - len(raw.frames)
        if missing:
            between = f"{counted(missing, 'frame')} between the first and the last"
            remarks.append(f"{between} are not in the file; the times count them")
    return Timing(numbers / hertz, statements, remarks)


def _time_unit(raw: Raw, given: Given, file: str, faults: Faults) -> Statement | None:
    stated = raw.time_unit
    if stated:
        if given.time_unit and given.time_unit != stated.value:
            message = f"is {given.time_unit}, but {file} states {stated.value} ({stated.where}); leave it out"
            faults.add("--time-unit", given.time_unit, message)
            return None
        return Statement("times", stated.value, "file", stated.where)
    if given.time_unit:
        return Statement("times", given.time_unit, "user", "--time-unit")
    known = ", ".join(TIME_UNITS)
    message = f"states no unit for the times in {raw.times_where}; add it: --time-unit s (one of {known})"
    faults.put(question("time_unit", file, None, message, [*TIME_UNITS], raw.times_where))
    return None


def _from_both(
    raw: Raw,
    printed: Array,
    stated: Statement,
    rate: Statement,
    given: Given,
    file: str,
    faults: Faults,
) -> Timing | None:
    """Return times at multiples of the frame interval if ``printed`` [T] (s) are these, rounded; else add a fault."""
    hertz = _value(rate, raw, given)
    steps = _steps(printed, hertz, raw)
    if steps is not None:
        remarks = []
        largest = float(np.abs(printed - printed[0] - steps / hertz).max())
        if largest > 1e-9 * max(1.0, float(np.abs(printed).max())):
            remarks.append(f"printed times are rounded by up to {1e3 * largest:.2g} ms; times follow from the rate")
        others = [one for one in raw.rates if not _same(one.value, hertz)]
        if others:
            remarks.append(
                f"the file states {others[0].value:g} Hz ({others[0].where}), but its times have {hertz:g} Hz"
            )
        return Timing(printed[0] + steps / hertz, [rate, stated], remarks)
    _check_times(printed, raw, file)
    passed = raw.frames[-1] - raw.frames[0] if raw.frames is not None else len(printed) - 1
    measured = float(passed / (printed[-1] - printed[0]))
    agreed = any(_same(one.value, hertz) for one in raw.rates)
    if given.rate_hz is not None and agreed:
        times = _from_rate(raw, rate, given, file, faults)
        if times:
            times.remarks.append(f"{raw.times_where} has {measured:.4g} Hz and is not used, as you gave --rate-hz")
        return times
    if given.rate_hz is not None:
        rates = [*raw.rates, Stated(measured, raw.times_where)]
        faults.add("--rate-hz", given.rate_hz, _contradicts(given.rate_hz, file, rates))
        return None
    differ = f"states {hertz:g} Hz ({rate.where}), but {raw.times_where} has {measured:.6g} Hz"
    message = f"{differ}; say which is right: --rate-hz"
    faults.put(question("rate_hz", file, f"{measured:.6g}", message, [f"{hertz:.9g}", f"{measured:.6g}"]))
    return None


def _steps(printed: Array, hertz: float, raw: Raw) -> Array | None:
    """Return the frame intervals [T] since the first frame, if ``printed`` times are these, rounded; else None."""
    if not np.isfinite(printed).all():
        return None
    since = printed - printed[0]
    tolerance = _ROUNDING * _resolution(printed) + _DRIFT * float(np.abs(printed).max())
    if raw.frames is not None:
        steps = (raw.frames - raw.frames[0]).astype(np.float64)
    else:
        nearest = np.round(since * hertz)
        consecutive = np.arange(len(printed), dtype=np.float64)
        # Times that are rounded so that they repeat: frames are consecutive if that fits as well.
        in_order = bool((np.abs(since - consecutive / hertz) <= 2 * tolerance).all())
        steps = consecutive if in_order else nearest
        if (np.diff(steps) <= 0).any() or np.gcd.reduce(np.diff(steps).astype(np.int64)) != 1:
            return None
        # Any time is near some multiple of a frame interval that is shorter than the rounding.
        if not in_order and (np.abs(since * hertz - steps) > _FURTHEST).any():
            return None
    # The first printed time is rounded, too.
    return steps if (np.abs(since - steps / hertz) <= 2 * tolerance).all() else None


def _resolution(printed: Array) -> float:
    """Return the last decimal with which times were printed, s."""
    for decimals in range(_MOST_DECIMALS + 1):
        scaled = printed * 10.0**decimals
        if np.abs(scaled - np.round(scaled)).max() < 1e-6 * max(1.0, float(np.abs(scaled).max()) * 1e-6):
            return float(10.0**-decimals)
    return float(10.0**-_MOST_DECIMALS)


def _check_times(times: Array, raw: Raw, file: str, unit: str = " s") -> None:
    """Raise DatasetError unless ``times`` are complete and increase; ``unit``: as it stands behind a number."""
    if not np.isfinite(times).all():
        at = int(np.flatnonzero(~np.isfinite(times))[0])
        raise _time_fault(
            raw,
            at,
            file,
            None,
            f"is empty; every {raw.row_word.removesuffix('s')} needs a time: fill it in, or remove the row",
        )
    wrong = np.flatnonzero(~(np.diff(times) > 0))
    if len(wrong):
        at = int(wrong[0]) + 1
        follows = f"follows {times[at - 1]:g}{unit}"
        what = "repeats the time of the frame before" if times[at] == times[at - 1] else follows
        message = f"{times[at]:g}{unit} {what}; times must increase: sort the rows"
        if choices := raw.row_choices(times):
            message = (
                f"{times[at]:g}{unit} {what}, because the table holds several recordings; choose the rows of one, as "
                f"times must increase: {_choices(choices)}"
            )
            raise ask("rows", _place(raw, at, file), float(times[at]), message, choices)
        if (np.diff(times) >= 0).all():
            raise repeated(raw, times, file, unit)
        message += ", or give those of one recording: --rows COLUMN=VALUE"
        raise _time_fault(raw, at, file, float(times[at]), message)


def _check_steps(steps: Array, raw: Raw, file: str) -> None:
    """Raise DatasetError if no camera takes frames as fast, or as slowly, as times that are ``steps`` (s) apart."""
    least = float(steps.min())
    if least * (1 + _SAME_RATE) >= 1 / MAX_RATE and least <= (1 + _SAME_RATE) / MIN_RATE:
        return
    limits = f"must lie in [{1 / MAX_RATE:g}, {1 / MIN_RATE:g}] s"
    message = f"{raw.row_word} are {least:.4g} s apart, which {limits}; check the unit of the times (--time-unit)"
    raise fail(f"{file}, {raw.times_where}", least, message)


def _choices(values: Sequence[str]) -> str:
    """Return the option ``rows`` with the first of ``values``, and the other values."""
    others = f" (or {', '.join(values[1:_LISTED])}" if len(values) > 1 else ""
    more = f", and {len(values) - _LISTED} more" if len(values) > _LISTED else ""
    return f"--rows {shlex.quote(values[0])}{others}{more}{')' if others else ''}"


def _time_fault(raw: Raw, at: int, file: str, value: float | None, message: str) -> DatasetError:
    return fail(_place(raw, at, file), value, message)


def _place(raw: Raw, at: int, file: str) -> str:
    return f"{file}, {raw.line_word} {raw.lines[at]}, {raw.times_where}"
