"""Exports of a diagnosis: the ranking of its hypotheses as CSV, all of it as JSON, maps and misfits as NetCDF."""

from __future__ import annotations

from typing import Any

import numpy as np

from wingfit.client.export_answers import DiagnosisExport
from wingfit.service.diagnoses import views as diagnosis_views
from wingfit.service.http import csv_text
from wingfit.service.runs import netcdf_variables as nc
from wingfit.service.runs.exports import Exported
from wingfit.service.storage.tables import DiagnosisRow

Json = dict[str, Any]
RANKING = (
    "title", "family", "source", "signature", "probability", "evidence", "score", "freedom", "explained", "predicted",
)  # fmt: skip
# Units of loads as CF conventions write them.
CF_UNITS = {"N/m": "N m-1"}
CONDITION = (
    ("flap_frequency_hz", "Hz", "flap frequency"),
    ("phase_lag_deg", "degree", "lag of the rear rod behind the front one"),
    ("pressure_mbar", "mbar", "pressure of the air"),
    ("airspeed", "m s-1", "airspeed"),
)
MODELS = {"before": "nominal model, refitted", "after": "model with the named effects"}
SPAN = "part of the span, root 0, tip 1"
PHASE = "phase of the beat"


def document(exported: Exported[DiagnosisRow], found: Json) -> DiagnosisExport:
    """Return the JSON export: the diagnosis, its dataset, and ``found``, the finding as JSON."""
    heading = exported.heading("diagnosis-export")
    return DiagnosisExport(**heading, diagnosis=diagnosis_views.diagnosis(exported.row), finding=found)


def table(found: Json) -> str:
    """Return ``found``, a finding as JSON, as CSV: one hypothesis per line, the most probable first.

    The hypothesis without effects is the nominal model.
    """
    head = ["rank", "effects", *RANKING, f"misfit_{found['unit'].lower()}", "refitted"]
    rows = [
        [rank, " + ".join(one["effects"]), *(one[name] for name in RANKING), one["misfit"], one["refitted"]]
        for rank, one in enumerate(found["hypotheses"], 1)
    ]
    return csv_text.lines([head, *rows])


def file(exported: Exported[DiagnosisRow], found: Json) -> bytes:
    """Return ``found``, a finding as JSON, as the bytes of a NetCDF file.

    One group each has the misfit by recording, by marker, and by span and phase of the beat, and each missing load. Of
    a series: by recording and by channel, and values over time of the channels that the report shows.
    """
    row = exported.row

    def write(root: Any) -> None:
        _recordings(root, found)
        _channels(root, found)
        _overlays(root, found)
        _markers(root, found)
        _phase_map(root, found)
        for number, load in enumerate(found["missing"], 1):
            _load(root.create_group(f"missing/{number}"), load)

    attributes = nc.provenance(row, exported.dataset, found["model"], exported.at) | {
        "title": f"diagnosis {row.name}",
        "comment": found["summary"],
        "verdict": found["verdict"],
        "named": ", ".join(found["named"]),
        "added_effects": ", ".join(found["added_effects"]),
        "noise": found["floors"]["noise"],
        "floor": found["floors"]["total"],
    }
    return nc.made(write, attributes)


def _recordings(root: Any, found: Json) -> None:
    """Write a group with the misfit to each recording into ``root``; ``found``: the finding as JSON.

    Misfits are those without and with the named effects, with 90 % intervals.
    """
    items, unit, along = found["recordings"], _units(found["unit"]), ("recording",)
    if not items:
        return
    group = root.create_group("recordings")
    group.dimensions = {"recording": len(items)}
    nc.texts(group, "recording", "recording", "recording", (one["name"] for one in items))
    nc.flags(group, "held_out", "recording", "whether it was held out", (one["held_out"] for one in items))
    for name, units, meaning in CONDITION if found.get("kind") != "series" else ():
        nc.numbers(group, name, along, units, meaning, _all(items, name))
    if settings := list(dict.fromkeys(name for one in items for name in one.get("settings", ()))):
        group.dimensions["setting"] = len(settings)
        nc.texts(group, "setting", "setting", "setting of a recording", settings)
        values = np.array([nc.or_nan(one["settings"].get(name) for name in settings) for one in items])
        meaning = "value of a setting, in its unit in the dataset"
        nc.numbers(group, "setting_value", ("recording", "setting"), nc.NO_UNIT, meaning, values)
    for name, model in MODELS.items():
        for end, meaning in (("value", ""), ("low", ", lower end of its 90 % interval"), ("high", ", upper end of it")):
            values = nc.or_nan(one[name][end] for one in items)
            label = name if end == "value" else f"{name}_{end}"
            nc.numbers(group, label, along, unit, f"misfit of the {model}{meaning}", values)
    nc.numbers(group, "floor", along, unit, "misfit expected of a correct model", _all(items, "floor"))


def _channels(root: Any, found: Json) -> None:
    """Write a group with the misfit of each channel of a series, in its own unit, into ``root``."""
    items, along = found.get("channels", []), ("channel",)
    if not items:
        return
    group = root.create_group("channels")
    group.dimensions = {"channel": len(items)}
    nc.texts(group, "channel", "channel", "channel", (one["name"] for one in items))
    nc.texts(
        group, "unit", "channel", "unit of the misfits and the noise of the channel", (one["unit"] for one in items)
    )
    meanings = {
        "noise": "standard deviation of one sample",
        "before": "misfit beyond the noise, nominal model",
        "after": "misfit beyond the noise, with the named effects",
    }
    for name, meaning in meanings.items():
        nc.numbers(group, name, along, nc.NO_UNIT, f"{meaning}, in the unit of the channel", _all(items, name))


def _overlays(root: Any, found: Json) -> None:
    """Write the values over time of the channels of a series that the report shows into ``root``, a group for each."""
    shown = [one for one in found["overlays"] if one.get("times")]
    for number, one in enumerate(shown, 1):
        nc.curve(root.create_group(f"overlays/{number}"), one, one["times"], MODELS)


def _markers(root: Any, found: Json) -> None:
    """Write a group with the misfit of each marker or force axis into ``root``; ``found``: the finding as JSON."""
    items, unit, along = found["markers"], found["unit"], ("marker",)
    if not items:
        return
    group = root.create_group("markers")
    group.dimensions = {"marker": len(items), "axis": 3}
    nc.texts(group, "marker", "marker", "marker or force axis", (one["name"] for one in items))
    nc.texts(group, "axis", "axis", "axis", "xyz")
    places = {
        "span": (nc.NO_UNIT, SPAN),
        "chord": (nc.NO_UNIT, "part of the chord, leading edge 0, trailing edge 1"),
        "x": ("m", "place on the wing, aft"),
        "y": ("m", "place on the wing, outboard"),
        "before": (unit, "misfit beyond the noise, nominal model"),
        "after": (unit, "misfit beyond the noise, with the named effects"),
        "worst": (nc.NO_UNIT, f"{PHASE} where the misfit is largest"),
    }
    for name, (units, meaning) in places.items():
        nc.numbers(group, name, along, units, meaning, _all(items, name))
    directions = np.array([one["direction"] for one in items])
    meaning = "mean direction of the misfit at that phase"
    nc.numbers(group, "direction", ("marker", "axis"), nc.NO_UNIT, meaning, directions)


def _phase_map(root: Any, found: Json) -> None:
    """Write a group with the misfit by span and phase of the beat into ``root``; ``found``: the finding as JSON."""
    given, unit = found["phase_map"], found["unit"]
    if given is None:
        return
    group = root.create_group("phase_map")
    group.dimensions = {"band": len(given["bands"]), "phase": len(given["phase"])}
    nc.numbers(group, "band", ("band",), nc.NO_UNIT, SPAN, given["bands"])
    nc.numbers(group, "phase", ("phase",), nc.NO_UNIT, PHASE, given["phase"])
    nc.numbers(group, "before", ("band", "phase"), unit, "misfit of the nominal model", given["before"])
    nc.numbers(group, "after", ("band", "phase"), unit, "misfit of the model with the named effects", given["after"])
    nc.numbers(group, "noise", (), unit, "misfit from noise alone in a cell", given["noise"])


def _load(group: Any, load: Json) -> None:
    """Write ``load``, what the nominal model misses in one recording, into ``group``: a force, or a rod's rotation."""
    units, along = str(CF_UNITS.get(load["unit"], load["unit"])), ("station", "phase")
    meaning = f"rotation missing at rod {load['rod']}" if load["rod"] else "force missing from the nominal model"
    nc.describe(group, {"recording": load["recording"], "rod": load["rod"]})
    group.dimensions = {"station": len(load["stations"]), "phase": len(load["phase"])}
    nc.numbers(group, "station", ("station",), nc.NO_UNIT, SPAN, load["stations"])
    nc.numbers(group, "phase", ("phase",), nc.NO_UNIT, PHASE, load["phase"])
    nc.numbers(group, "value", along, units, meaning, load["values"])
    nc.numbers(group, "error", along, units, f"standard error of the {meaning}", load["errors"])


def _units(unit: str) -> str:
    """Return ``unit`` of a finding as CF conventions write it: misfits of a series are multiples of the noise."""
    return nc.NO_UNIT if unit == "noise" else unit


def _all(items: list[Json], name: str) -> Any:
    return nc.or_nan(one[name] for one in items)
