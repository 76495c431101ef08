"""Writes a whole dataset from tracks alone, so that a new user sees them at once and corrects what was assumed.

Tracks in the axes of a wing become a dataset of a rigid wing; any other tracks become series of positions, which
describe no wing (docs/formats.md). Each number in the description is from the file, from the user, from the tracks, or
marked as assumed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from wingfit.importers.markers import allowed, listed
from wingfit.importers.options import question
from wingfit.importers.start.frequency import flap_frequency
from wingfit.importers.start.wing import Fact, describe_wing, refuse_two_wings
from wingfit.importers.tracks import DECIMALS, ImportedTracks
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import DatasetError, Faults, counted, fail
from wingfit.records.limits import MAX_QUANTITIES

ASSUMED: Mapping[str, str | float] = MappingProxyType(
    {"rig": "wind_tunnel", "phase_lag_deg": 0, "pressure_mbar": 1013.25, "temperature_c": 20}
)
"""Conditions of a recording, in the units of dataset.yaml, that tracks do not show; there is no rear rod."""
MIN_FREQUENCY, MAX_FREQUENCY = 0.01, 1000.0  # Hz, those of dataset.yaml
_HEAD = """\
# First description, from the tracks alone. Replace what is marked ASSUMED by what you know (docs/formats.md).
format_version: 1
name: {name}
description: "{about}"
"""
_WING = "Described from the tracks alone: planform, mass, pressure and temperature are assumed."
_SERIES = "Positions of markers, in m; no wing is described."


@dataclass(frozen=True)
class Conditions:
    """What the user states about the recordings; None: not stated. Frequency in Hz, airspeed in m/s.

    ``rows``: the rows of each file that are the recording ("sequence=3,side=left"); its values name the recording.
    """

    flap_frequency_hz: float | None = None
    airspeed_m_s: float | None = None
    rows: str | None = None


@dataclass(frozen=True)
class Start:
    """A dataset: ``kind`` "wing" or "series", its ``files`` {path: text}, and the ``facts`` of the description.

    ``yaml`` is the part of dataset.yaml that does not depend on the recordings: the wing, or rig and channels.
    ``flap_frequency_hz`` of each recording; empty for series.
    """

    kind: str
    yaml: str
    files: dict[str, str]
    facts: tuple[Fact, ...]
    flap_frequency_hz: tuple[float, ...] = ()


def start_dataset(found: Sequence[ImportedTracks], name: str, given: Conditions) -> Start:
    """Return a dataset called ``name`` of all tracks ``found``, which must have the same markers and axes.

    DatasetError asks for what cannot be seen in the tracks: a flap frequency, the markers of one wing.
    """
    _check_alike(found)
    names = _recording_names([one.file for one in found], given.rows)
    head = {"name": json.dumps(name, ensure_ascii=False)}
    if found[0].frame != "wing":
        channels, left_out = _channels(found)
        yaml, facts = _series(channels, left_out, name)
        tables = {
            f"recordings/{called}.csv": _columns(one.csv(), channels) for called, one in zip(names, found, strict=True)
        }
        text = _HEAD.format(**head, about=_SERIES) + yaml + "recordings:\n"
        text += "".join(f"  - {{name: {json.dumps(called)}, settings: {{}}}}\n" for called in names)
        return Start("series", yaml, {"dataset.yaml": text} | tables, facts)
    for one in found:
        refuse_two_wings(one)
    tables = {f"recordings/{called}.csv": one.csv() for called, one in zip(names, found, strict=True)}
    rates = [_frequency(one, given) for one in found]
    wing = describe_wing(found[0], rates[0], name)
    source = "user: --flap-frequency-hz" if given.flap_frequency_hz else "tracks; count the beats to confirm it"
    air = f"{ASSUMED['pressure_mbar']} mbar, {ASSUMED['temperature_c']} deg C"
    facts = (
        Fact("flap frequency", ", ".join(f"{rate:.4g} Hz" for rate in rates), source),
        *wing.facts,
        Fact("air", air, "assumed"),
        Fact("airspeed", f"{given.airspeed_m_s or 0:g} m/s", "assumed" if given.airspeed_m_s is None else "user"),
    )
    text = _HEAD.format(**head, about=_WING) + wing.yaml + "recordings:        # ASSUMED: pressure, temperature"
    text += ", airspeed\n" if given.airspeed_m_s is None else "\n"
    assumed = ", ".join(f"{key}: {value}" for key, value in ASSUMED.items())
    for called, rate in zip(names, rates, strict=True):
        text += (
            f"  - {{name: {json.dumps(called)}, flap_frequency_hz: {rate:.5g}, {assumed},\n"
            f"     airspeed_m_s: {given.airspeed_m_s or 0:g}}}\n"
        )
    return Start("wing", wing.yaml, {"dataset.yaml": text} | tables, facts, tuple(rates))


def _channels(found: Sequence[ImportedTracks]) -> tuple[list[str], list[str]]:
    """Return the coordinates that change, and those that never do, which a dataset refuses: a sensor may be broken."""
    tracks = found[0]
    coordinates = [(marker, axis) for marker in tracks.markers for axis in range(3)]
    moved = {
        (marker, axis): any(_changes(one.positions[:, one.markers.index(marker), axis]) for one in found)
        for marker, axis in coordinates
    }
    names = {(marker, axis): f"{marker}_{'xyz'[axis]}_m" for marker, axis in coordinates}
    channels = [names[one] for one in coordinates if moved[one]]
    if not channels:
        raise fail(tracks.file, None, "holds markers that never move; export a part in which they do")
    if len(channels) > MAX_QUANTITIES:
        message = (
            f"has {len(tracks.markers)} markers; a dataset of positions holds {MAX_QUANTITIES // 3}: choose those "
            f"that you need: --markers {','.join(tracks.markers[:3])}"
        )
        raise DatasetError([question("markers", tracks.file, len(tracks.markers), message)])
    return channels, [names[one] for one in coordinates if not moved[one]]


def _changes(values: Float[Array, " T"]) -> bool:
    seen = np.round(values[np.isfinite(values)], DECIMALS)
    return bool(seen.size and seen.max() > seen.min())


def _series(channels: Sequence[str], left_out: Sequence[str], name: str) -> tuple[str, tuple[Fact, ...]]:
    lines = [f"rig: {json.dumps(name, ensure_ascii=False)}", "channels:"]
    lines += [f"  - {{name: {json.dumps(channel)}, unit: m}}" for channel in channels]
    facts = [Fact("channels", f"{len(channels)}: x, y and z of the markers", "tracks")]
    if left_out:
        many = f"{counted(len(left_out), 'coordinate')} that never change{'s' if len(left_out) == 1 else ''}"
        facts.append(Fact("left out", f"{many}: {listed(left_out)}", "tracks"))
    return "\n".join([*lines, ""]), tuple(facts)


def _columns(csv: str, channels: Sequence[str]) -> str:
    """Return the table ``csv`` with the columns of time and ``channels``."""
    rows = [line.split(",") for line in csv.splitlines()]
    keep = [k for k, column in enumerate(rows[0]) if k == 0 or column in channels]
    if len(keep) == len(rows[0]):
        return csv
    return "".join(",".join([row[k] for k in keep]) + "\n" for row in rows)


def _frequency(tracks: ImportedTracks, given: Conditions) -> float:
    rate = given.flap_frequency_hz or flap_frequency(tracks.times, tracks.positions)
    if rate is None or not MIN_FREQUENCY <= rate <= MAX_FREQUENCY:
        message = "shows no clear flap frequency; add it: --flap-frequency-hz 5"
        raise DatasetError([question("flap_frequency_hz", tracks.file, None, message)])
    return rate


def _check_alike(found: Sequence[ImportedTracks]) -> None:
    """Raise DatasetError if the tracks have different markers."""
    faults = Faults()
    for one in found[1:]:
        if set(one.markers) != set(found[0].markers):
            odd = sorted(set(one.markers) ^ set(found[0].markers))
            message = f"has other markers than {found[0].file} ({', '.join(odd[:4])}); choose those of both: --markers"
            faults.add(one.file, None, message)
    faults.raise_any()


def _recording_names(files: Sequence[str], rows: str | None) -> list[str]:
    chosen = allowed("_".join(part.partition("=")[2].strip() for part in (rows or "").split(",")))
    names = list[str]()
    for file in files:
        stem = chosen or allowed(file.rsplit(".", 1)[0]) or "recording"
        name, number = stem, 2
        while name in names:
            name, number = f"{stem}-{number}", number + 1
        names.append(name)
    return names
