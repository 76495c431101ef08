"""What a drawing of a wing shows, from a wing, a vehicle, or a ``dataset.yaml`` that is not filled in yet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from wingfit.records.description import fields
from wingfit.records.description.placeholder import missing
from wingfit.records.description.wing_file import Place
from wingfit.records.description.yaml_text import Document, read_yaml
from wingfit.records.errors import Faults, fail
from wingfit.records.vehicle import Vehicle
from wingfit.records.wing import Wing


@dataclass(frozen=True)
class WingPlan:
    """A wing seen from above; x aft, y outboard, m.

    Attributes:
        name: of the wing.
        stations: (y, leading edge x, chord) of each section, from root to tip.
        hinge: y of the flapping axis; None: not stated.
        rods: (name, x and y of the root, x and y of the tip) of each rod.
        markers: (name, x, y) of each marker at rest.
        reference_markers: names of those that show the start of a beat.
    """

    name: str
    stations: tuple[tuple[float, float, float], ...]
    hinge: float | None = None
    rods: tuple[tuple[str, float, float, float, float], ...] = ()
    markers: tuple[tuple[str, float, float], ...] = ()
    reference_markers: frozenset[str] = frozenset()


def plan_of(rig: Wing | Vehicle) -> WingPlan:
    """Return the plan of a wing, or of a wing of a vehicle, with a straight pitch axis; the flapping axis is y = 0."""
    if isinstance(rig, Vehicle):
        stations = tuple((s.r, -rig.pitch_axis * s.chord, s.chord) for s in rig.stations)
        return WingPlan(rig.name, stations, 0.0)
    return WingPlan(
        name=rig.name,
        stations=tuple((s.y, s.leading_edge, s.chord) for s in rig.stations),
        hinge=rig.hinge.y,
        rods=tuple((rod.name, rod.x_root, rod.y_root, rod.x_tip, rod.y_tip) for rod in rig.rods),
        markers=tuple((marker.name, marker.position[0], marker.position[1]) for marker in rig.markers),
        reference_markers=frozenset(rig.reference_markers),
    )


class _Part(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)


class _Station(_Part):
    y_m: Place
    leading_edge_m: Place
    chord_m: fields.Chord


class _Rod(_Part):
    name: fields.Name
    x_root_m: Place
    y_root_m: Place
    x_tip_m: Place
    y_tip_m: Place


class _Marker(_Part):
    name: fields.Name
    x_m: Place
    y_m: Place


class _Hinge(_Part):
    y_m: Place


class _Wing(_Part):
    name: fields.Title = "wing"
    stations: list[_Station] = Field(min_length=2)
    rods: list[_Rod] = Field(default_factory=list)
    markers: list[_Marker] = Field(default_factory=list)
    reference_markers: list[fields.Name] = Field(default_factory=list)
    hinge: _Hinge | None = None


def read_plan(raw: bytes, file: str) -> WingPlan:
    """Return the plan of the wing in the contents ``raw`` of a ``dataset.yaml``; placeholders are left out.

    DatasetError names what a drawing needs and the file does not have.
    """
    document = read_yaml(raw, file)
    data = document.data
    if not isinstance(data, Mapping) or not isinstance(data.get("wing"), Mapping):
        raise fail(file, None, "describes no wing (key 'wing'); name a dataset.yaml of a wing, or its folder")
    try:
        wing = _Wing.model_validate(_filled(data["wing"]))
    except ValidationError as error:
        raise _faults(error, document) from None
    hinge = None if wing.hinge is None else float(wing.hinge.y_m)
    return WingPlan(
        name=wing.name,
        stations=tuple((float(s.y_m), float(s.leading_edge_m), float(s.chord_m)) for s in wing.stations),
        hinge=hinge,
        rods=tuple(
            (r.name, float(r.x_root_m), float(r.y_root_m), float(r.x_tip_m), float(r.y_tip_m)) for r in wing.rods
        ),
        markers=tuple((m.name, float(m.x_m), float(m.y_m)) for m in wing.markers),
        reference_markers=frozenset(wing.reference_markers),
    )


def _filled(value: Any) -> Any:
    """Return plain data without placeholders."""
    if isinstance(value, Mapping):
        return {key: _filled(item) for key, item in value.items() if missing(item) is None}
    if isinstance(value, list):
        return [_filled(item) for item in value if missing(item) is None]
    return value


def _faults(error: ValidationError, document: Document) -> Exception:
    faults = Faults()
    for one in error.errors(include_url=False):
        what = "is missing; a drawing needs it" if one["type"] == "missing" else one["msg"]
        faults.add(document.where(("wing", *one["loc"])), None, what)
    try:
        faults.raise_any()
    except ValueError as found:
        return found
    return error
