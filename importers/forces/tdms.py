"""Reads the channels of a balance from a TDMS file (LabVIEW), with npTDMS, an optional library."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from wingfit.importers.forces.channels import ROLES, Channels, role_of, time_unit_of
from wingfit.importers.options import pairs_of
from wingfit.importers.raw import Stated
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import DatasetError, Faults, check_most, fail, nearest
from wingfit.records.limits import MAX_ROWS

START = b"TDSm"


def read_tdms(raw: bytes, file: str, columns: str | None, group: str | None) -> Channels:
    """Return the channels of forces in a TDMS file; DatasetError if it cannot be read, or npTDMS is not installed."""
    try:
        from nptdms import TdmsFile
    except ImportError:
        remedy = "pip install 'wingfit[tdms]', or export the channels as CSV"
        raise fail(file, "TDMS", f"is a TDMS file; reading it needs the library npTDMS: {remedy}") from None
    try:
        opened = TdmsFile.read(io.BytesIO(raw))
        return _channels(opened, file, columns, group)
    except DatasetError:
        raise
    except Exception as error:  # the library raises errors of many kinds for damaged files
        raise fail(file, None, f"cannot be read as TDMS ({type(error).__name__}: {error}); export it as CSV") from None


def _channels(opened: Any, file: str, columns: str | None, group: str | None) -> Channels:
    asked = dict(pairs_of("--columns", columns, ";", "time=t; fx=ch1")) if columns else None
    groups = {one.name: {channel.name: channel for channel in one.channels()} for one in opened.groups()}
    fitting = {name: roles for name, channels in groups.items() if (roles := _roles(channels, asked))}
    if group is not None:
        if group not in groups:
            raise fail("--group", group, f"{file} has no group {group!r}; {nearest(group, groups)}")
        fitting = {name: roles for name, roles in fitting.items() if name == group}
    if not fitting:
        listed = "; ".join(f"{name}: {', '.join(channels)}" for name, channels in groups.items())[:300]
        message = (
            f"no channel is a force (Fx, Fz, lift, drag, thrust); say which: --columns 'fx=NAME; fz=NAME' ({listed})"
        )
        raise fail(file, None, message)
    if len(fitting) > 1:
        raise fail(file, len(fitting), f"several groups have forces: {', '.join(fitting)}; choose one: --group NAME")
    ((name, roles),) = fitting.items()
    return _read(groups[name], roles, file)


def _roles(channels: dict[str, Any], asked: dict[str, str] | None) -> dict[str, str]:
    """Return the names of the channels by role ("time" too); empty if there is no force."""
    if asked is not None:
        unknown = [role for role in asked if role not in ("time", *ROLES)]
        if unknown:
            raise fail("--columns", unknown[0], f"{unknown[0]!r} is none of time, {', '.join(ROLES)}")
        return dict(asked) if set(asked.values()) <= set(channels) else {}
    roles, faults = dict[str, str](), Faults()
    for name in channels:
        found = role_of(name)
        role = "time" if time_unit_of(name)[0] else found[0] if found else None
        if role is not None and role in roles:
            faults.add(name, name, f"is a second channel of {role}, beside {roles[role]!r}; say which: --columns")
        if role is not None:
            roles.setdefault(role, name)
    faults.raise_any()
    return roles if set(roles) & set(ROLES) else {}


def _read(channels: dict[str, Any], roles: dict[str, str], file: str) -> Channels:
    values = {role: _numbers(channels[name], file) for role, name in roles.items()}
    lengths = {role: len(one) for role, one in values.items()}
    if len(set(lengths.values())) > 1:
        raise fail(file, None, f"channels have different lengths ({lengths}); export those of one recording")
    count = next(iter(lengths.values()))
    units, rates = dict[str, Stated[str]](), list[Stated[float]]()
    for role, name in roles.items():
        properties = channels[name].properties
        unit = str(properties.get("unit_string") or properties.get("NI_UnitDescription") or "")
        unit = unit or (found[1] if (found := role_of(name)) else "")
        if unit and role != "time":
            units[role] = Stated(unit, f"channel {name!r}")
        step = properties.get("wf_increment")
        if role != "time" and isinstance(step, (int, float)) and step > 0:
            rates.append(Stated(1.0 / float(step), f"channel {name!r}, wf_increment"))
    times = values.pop("time", None)
    time_unit = time_unit_of(roles.get("time", ""))[1]
    ignored = [name for name in channels if name not in roles.values()]
    return Channels(
        values=values,
        names={role: name for role, name in roles.items() if role != "time"},
        units=units,
        lines=np.arange(1, count + 1),
        line_word="sample",
        times=times,
        time_unit=None if time_unit is None else Stated(time_unit, f"channel {roles['time']!r}"),
        times_where="" if times is None else f"channel {roles['time']!r}",
        rates=rates,
        title="TDMS file",
        remarks=[f"not imported: {', '.join(ignored[:8])}{', ...' if len(ignored) > 8 else ''}"] if ignored else [],
    )


def _numbers(channel: Any, file: str) -> Float[Array, " T"]:
    """Return the samples of a channel; DatasetError for text, times of day, infinite numbers and too many samples."""
    check_most(file, "has", len(channel), MAX_ROWS, "samples", "cut the recording in parts")
    data = np.asarray(channel[:])
    if data.dtype.kind not in "fiu":
        raise fail(f"{file}, channel {channel.name!r}", None, f"holds {data.dtype}, not numbers; choose with --columns")
    numbers = data.astype(np.float64)
    if np.isinf(numbers).any():
        raise fail(f"{file}, channel {channel.name!r}", "inf", "holds an infinite number; export it again")
    return numbers
