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

    One group each has the misfit by recording, by marker, and by span and phase of the beat, and each missing load.
    """
    row = exported.row

    def write(root: Any) -> None:
        _recordings(root, found)
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
    items, unit, along = found["recordings"], found["unit"], ("recording",)
    if not items:
        return
    group = root.create_group("recordings")
    group.dimensions = {"recording": len(items)}
    nc.texts(group, "recording", "recording", "recording", (one["name"] for one in items))
    nc.flags(group, "held_out", "recording", "whether it was held out", (one["held_out"] for one in items))
    for name, units, meaning in CONDITION:
        nc.numbers(group, name, along, units, meaning, _all(items, name))
    for name, model in (("before", "nominal model, refitted"), ("after", "model with the named effects")):
        for end, meaning in (("value", ""), ("low", ", lower end of its 90 % interval"), ("high", ", upper end of it")):
            values = nc.or_nan(one[name][end] for one in items)
            label = name if end == "value" else f"{name}_{end}"
            nc.numbers(group, label, along, unit, f"misfit of the {model}{meaning}", values)
    nc.numbers(group, "floor", along, unit, "misfit expected of a correct model", _all(items, "floor"))


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


def _all(items: list[Json], name: str) -> Any:
    return nc.or_nan(one[name] for one in items)
