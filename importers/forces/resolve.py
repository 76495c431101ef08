"""Where the statements of the file and those of the user meet: newtons, seconds, body axes (x to the nose, z down)."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from wingfit.importers.axes import read_axes
from wingfit.importers.forces.channels import FORCE_UNITS, Channels, force_unit
from wingfit.importers.limits import MAX_FORCE
from wingfit.importers.options import Given
from wingfit.importers.raw import Raw
from wingfit.importers.times import resolve_times
from wingfit.records.array_types import Array, Float
from wingfit.records.dataset import ForceAxis
from wingfit.records.errors import DatasetError, Faults, counted, fail, shown
from wingfit.records.files.table import write_table
from wingfit.records.limits import MIN_FRAMES, UNEVEN_STEPS

AXES_EXAMPLE = "x nose, y right, z down"
Balance = Literal["body", "wind"]
_DECIMALS = 12  # of newtons


@dataclass(frozen=True)
class ForceFact:
    """One fact about the forces: its ``value``, stated ``by`` the file or the user, and ``where``."""

    fact: str
    value: str
    by: Literal["file", "user"]
    where: str


@dataclass(frozen=True)
class ForceOptions:
    """Statements of the user: see :func:`wingfit.importers.forces.import_forces.import_forces`."""

    unit: str | None = None
    rate_hz: float | None = None
    time_unit: str | None = None
    axes: str | None = None
    balance: Balance | None = None
    body_pitch_deg: float | None = None
    start_s: float | None = None

    def check(self) -> None:
        """Raise DatasetError, which names all options with a wrong value."""
        faults = Faults()
        if self.unit is not None and self.unit not in FORCE_UNITS:
            faults.add("--unit", self.unit, f"is {self.unit!r}; it must be one of {', '.join(FORCE_UNITS)}")
        if self.balance not in (None, "body", "wind"):
            faults.add("--balance", self.balance, f"is {self.balance!r}; it must be body or wind")
        pitch = self.body_pitch_deg
        if pitch is not None and not -180 <= pitch <= 180:
            faults.add("--body-pitch-deg", pitch, f"is {pitch:g} deg; it must lie in [-180, 180] deg")
        if self.start_s is not None and not math.isfinite(self.start_s):
            faults.add("--start-s", self.start_s, "must be a finite number of seconds")
        try:
            Given(rate_hz=self.rate_hz, time_unit=self.time_unit, axes=self.axes).check([])
        except DatasetError as error:
            faults.extend(error)
        if not faults.faults and self.axes is not None and read_axes(self.axes).frame != "body":
            message = f"is {self.axes!r}; forces are in body axes: use right or left, such as {AXES_EXAMPLE!r}"
            faults.add("--axes", self.axes, message)
        faults.raise_any()


@dataclass(frozen=True, eq=False)
class ImportedForces:
    """Forces of one file, as the wings exert them on the body.

    Attributes:
        file: name of the file, without folders.
        title: kind of the file.
        axes: axes that are there, "x" (to the nose) and "z" (down).
        times: [T], s.
        forces: [T, A], N; NaN for a gap.
        statements: what was stated, and by whom.
        remarks: what is not imported or was changed.
    """

    file: str
    title: str
    axes: tuple[ForceAxis, ...]
    times: Float[Array, " T"]
    forces: Float[Array, "T A"]
    statements: tuple[ForceFact, ...]
    remarks: tuple[str, ...]

    @property
    def rate_hz(self) -> float:
        """Return the samples per second."""
        return float((len(self.times) - 1) / (self.times[-1] - self.times[0]))

    def csv(self) -> str:
        """Return the forces as the table of a dataset: time_s, force_x_n, force_z_n."""
        return write_table(
            [f"force_{axis}_n" for axis in self.axes], self.times, np.round(self.forces, _DECIMALS) + 0.0
        )

    def summary(self) -> list[dict[str, Any]]:
        """Return for each axis its mean, smallest, largest and root mean square force, N, and the count of gaps."""
        rows = []
        for axis, force in zip(self.axes, self.forces.T, strict=True):
            there = force[np.isfinite(force)]
            low, high = float(there.min()), float(there.max())
            rms = float(np.sqrt(np.mean(there**2)))
            gaps = int(len(force) - len(there))
            rows.append(
                {"axis": axis, "mean_n": float(there.mean()), "low_n": low, "high_n": high, "rms_n": rms, "gaps": gaps}
            )
        return rows

    def as_json(self) -> dict[str, Any]:
        """Return everything but the samples, for JSON."""
        return {
            "file": self.file,
            "title": self.title,
            "samples": len(self.times),
            "start_s": float(self.times[0]),
            "duration_s": float(self.times[-1] - self.times[0]),
            "rate_hz": self.rate_hz,
            "statements": [asdict(one) for one in self.statements],
            "forces": self.summary(),
            "remarks": list(self.remarks),
        }


def resolve(channels: Channels, options: ForceOptions, file: str) -> ImportedForces:
    """Return the forces in newtons and body axes; DatasetError lists missing and contradicting options."""
    count = len(channels.lines)
    if count < MIN_FRAMES:
        raise fail(
            file, count, f"has {counted(count, 'sample')}; at least {MIN_FRAMES} are needed: export a longer part"
        )
    faults, facts = Faults(), list[ForceFact]()
    factors = _units(channels, options, file, facts, faults)
    given = Given(rate_hz=options.rate_hz, time_unit=options.time_unit)
    timing = resolve_times(_as_raw(channels), given, file, faults)
    balance = _balance(channels, options, file, facts, faults)
    faults.raise_any()
    if timing is None or balance is None:
        raise fail(file, None, "times and axes are missing")
    _check_even(timing.times, channels, file)
    newtons = {role: values * factors[role] for role, values in channels.values.items()}
    x, z, remarks = _body_axes(newtons, balance, options, file)
    found: list[tuple[ForceAxis, Array]] = [(axis, one) for axis, one in (("x", x), ("z", z)) if one is not None]  # type: ignore[misc]
    _check_forces(newtons, channels, file)
    _check_start(options.start_s, timing.times)
    times = timing.times - (options.start_s or 0.0)
    if options.start_s is None:
        remarks.append("time 0 of a dataset is the start of a beat; give it: --start-s, in seconds of the file")
    else:
        facts.append(ForceFact("start of a beat", f"{options.start_s:g} s", "user", "--start-s"))
    times_facts = [ForceFact(one.fact, one.value, one.by, one.where) for one in timing.statements]
    forces = np.column_stack([one for _, one in found])
    if not np.isfinite(forces).any(axis=0).all():
        raise fail(file, None, "an axis has no value in any row; choose other columns (--columns)")
    return ImportedForces(
        file=file,
        title=channels.title,
        axes=tuple(axis for axis, _ in found),
        times=times,
        forces=forces,
        statements=(*facts, *times_facts),
        remarks=tuple(dict.fromkeys([*channels.remarks, *timing.remarks, *remarks])),
    )


def _as_raw(channels: Channels) -> Raw:
    """Return the times of the channels as those of tracks without markers."""
    return Raw(
        [],
        np.zeros((len(channels.lines), 0, 3)),
        channels.lines,
        line_word=channels.line_word,
        row_word="samples",
        times=channels.times,
        time_unit=channels.time_unit,
        times_where=channels.times_where,
        rates=channels.rates,
    )


def _units(
    channels: Channels, options: ForceOptions, file: str, facts: list[ForceFact], faults: Faults
) -> dict[str, float]:
    """Return the newtons per unit of each channel; add a fault where nobody states them or statements contradict."""
    factors, unstated = dict[str, float](), list[str]()
    for role, name in channels.names.items():
        stated = channels.units.get(role)
        unit = force_unit(stated.value) if stated else None
        if stated and unit is None and options.unit is None:
            mass = (
                "; it is a unit of mass: if gram-force is meant, --unit gf" if stated.value.lower() in _MASSES else ""
            )
            known = ", ".join(FORCE_UNITS)
            which = f"{shown(stated.value)!r} of {name!r}"
            message = f"states the unit {which}, which is no unit of force{mass}; give --unit ({known})"
            faults.add(f"{file}, {stated.where}", stated.value, message)
        elif stated and unit and options.unit not in (None, unit):
            message = f"is {options.unit}, but {file} states {unit} for {name!r} ({stated.where}); leave it out"
            faults.add("--unit", options.unit, message)
        elif unit and stated:
            factors[role] = FORCE_UNITS[unit]
            facts.append(ForceFact(f"unit of {name}", unit, "file", stated.where))
        elif options.unit is not None and options.unit in FORCE_UNITS:
            factors[role] = FORCE_UNITS[options.unit]
            facts.append(ForceFact(f"unit of {name}", options.unit, "user", "--unit"))
        else:
            unstated.append(name)
    if unstated:
        known = ", ".join(FORCE_UNITS)
        faults.add(file, None, f"states no unit of {', '.join(unstated)}; add it: --unit N (one of {known})")
    return factors


_MASSES = {"g", "gr", "gram", "grams", "kg", "mg", "oz", "lb"}


def _balance(
    channels: Channels, options: ForceOptions, file: str, facts: list[ForceFact], faults: Faults
) -> Balance | None:
    """Return whether the channels are in body or in wind axes; add a fault for all that is missing for it."""
    roles = set(channels.values)
    winds, axes = roles & {"lift", "drag", "thrust"}, roles & {"fx", "fy", "fz"}
    if winds and axes:
        listed = ", ".join(channels.names.values())
        message = f"has forces by axis and by direction ({listed}); choose one kind: --columns 'fx=...; fz=...'"
        faults.add(file, listed, message)
        return None
    if {"drag", "thrust"} <= winds:
        message = "has drag and thrust, which are opposite; choose one: --columns 'lift=...; drag=...'"
        faults.add(file, "thrust", message)
        return None
    balance = _which(winds, options, file, facts, faults)
    _directions(bool(axes), options, file, facts, faults)
    _pitch(balance, options, file, facts, faults)
    return balance


def _which(winds: set[str], options: ForceOptions, file: str, facts: list[ForceFact], faults: Faults) -> Balance | None:
    if "drag" in winds or winds == {"lift"}:
        if options.balance == "body":
            message = "is body, but lift and drag are wind axes; if they are not, say so: --columns 'fx=...; fz=...'"
            faults.add("--balance", options.balance, message)
        facts.append(ForceFact("balance", "in wind axes", "file", "names: lift is up, drag is downstream"))
        return "wind"
    if options.balance is None:
        message = (
            "does not state whether the balance turns with the body; give --balance body (axes of the body) or "
            "--balance wind (axes of the stream)"
        )
        faults.add(file, None, message)
    else:
        facts.append(ForceFact("balance", f"in {options.balance} axes", "user", "--balance"))
    return options.balance


def _directions(has_axes: bool, options: ForceOptions, file: str, facts: list[ForceFact], faults: Faults) -> None:
    if has_axes and options.axes is None:
        message = f"does not state where its axes point; a force above 0 points there: --axes {AXES_EXAMPLE!r}"
        faults.add(file, None, message)
    elif has_axes and options.axes:
        facts.append(ForceFact("axes", options.axes, "user", "--axes"))
    elif options.axes:
        message = "is for Fx, Fy, Fz; the names lift, drag and thrust state their directions"
        faults.add("--axes", options.axes, message)


def _pitch(balance: Balance | None, options: ForceOptions, file: str, facts: list[ForceFact], faults: Faults) -> None:
    pitch = options.body_pitch_deg
    if balance == "wind" and pitch is None:
        message = "is in wind axes; give the pitch of the body, nose up from the stream: --body-pitch-deg 31"
        faults.add(file, None, message)
    elif balance == "wind":
        facts.append(ForceFact("body pitch", f"{pitch:g} deg", "user", "--body-pitch-deg"))
    elif balance == "body" and pitch is not None:
        faults.add("--body-pitch-deg", pitch, "is not needed for a balance in body axes; leave it out")


def _body_axes(
    newtons: dict[str, Array], balance: Balance, options: ForceOptions, file: str
) -> tuple[Array | None, Array | None, list[str]]:
    """Return the forces along x (to the nose) and z (down) of the body, None for an axis that is not there."""
    remarks = list[str]()
    if options.axes is not None:
        axes = read_axes(options.axes)
        rows = [newtons.get(f"f{'xyz'[axis]}") for axis in axes.order]
        fore, side, down = (None if one is None else one * sign for one, sign in zip(rows, axes.signs, strict=True))
        if axes.mirrors:
            remarks.append("these axes mirror: they are left-handed; check the direction of y")
        if side is not None:
            remarks.append("the side force is not imported: it is not modelled")
    else:
        drag, lift = newtons.get("drag"), newtons.get("lift")
        fore = -drag if drag is not None else newtons.get("thrust")
        down = -lift if lift is not None else None
    if balance == "body":
        if fore is None and down is None:
            raise fail(file, None, "has no force along the body or normal to it (x, z); choose others with --columns")
        return fore, down, remarks
    if fore is None or down is None:
        missing = "along the stream (drag or thrust)" if fore is None else "across it (lift)"
        raise fail(file, None, f"has no force {missing}; both are needed to turn wind axes into body axes")
    pitch = math.radians(options.body_pitch_deg or 0.0)
    c, s = math.cos(pitch), math.sin(pitch)
    return c * fore - s * down, s * fore + c * down, remarks


def _check_forces(newtons: dict[str, Array], channels: Channels, file: str) -> None:
    """Raise DatasetError for a force (N) that no balance for wings measures, or if all forces are exactly zero."""
    faults = Faults()
    for role, values in newtons.items():
        far = np.flatnonzero(np.abs(values) > MAX_FORCE)
        if len(far):
            at, name = int(far[0]), channels.names[role]
            message = f"is {values[at]:g} N; at most {MAX_FORCE:g} N are plausible: check the unit, or empty the cell"
            faults.add(
                f"{file}, {channels.line_word} {channels.lines[at]}, column {name!r}", f"{values[at]:g}", message
            )
    faults.raise_any()
    if all((values[np.isfinite(values)] == 0).all() for values in newtons.values()):
        message = (
            "all forces are exactly 0 N: nothing was measured; choose other columns (--columns), or export it again"
        )
        raise fail(file, 0, message)


def _check_start(start: float | None, times: Float[Array, " T"]) -> None:
    """Raise DatasetError if the beat starts outside the recording: every beat does as well, so one inside is meant."""
    first, last = float(times[0]), float(times[-1])
    if start is not None and not first <= start <= last:
        message = (
            f"is {start:g} s; it must lie in [{first:g}, {last:g}] s, the times of the file: give seconds, and any "
            "beat that starts inside"
        )
        raise fail("--start-s", start, message)


def _check_even(times: Float[Array, " T"], channels: Channels, file: str) -> None:
    """Raise DatasetError if the steps differ by more than a dataset of forces allows."""
    steps = np.diff(times)
    median = float(np.median(steps))
    off = np.abs(steps / median - 1)
    if off.max() > UNEVEN_STEPS:
        at = int(off.argmax()) + 1
        message = (
            f"the step to this sample is {1e3 * steps[at - 1]:.4g} ms, the median {1e3 * median:.4g} ms; forces need "
            f"even steps within {100 * UNEVEN_STEPS:g} %: give --rate-hz if only the printed times are rounded, write "
            "a row with empty cells for a lost sample, or resample"
        )
        raise fail(f"{file}, {channels.line_word} {channels.lines[at]}", float(times[at]), message)
