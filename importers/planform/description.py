"""Writes ``dataset.yaml`` for an outline, with a placeholder for everything that geometry does not show."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from wingfit.importers.planform.markers import PlacedMarker
from wingfit.importers.planform.options import OutlineOptions
from wingfit.importers.planform.stations import Sections
from wingfit.records.description.placeholder import placeholder

_HEAD = """\
# The wing of {file}, described by: wingfit wing-template
# Replace every "FILL IN" by the value; 'wingfit datasets check FOLDER' lists those that are left. This file is
# dataset.yaml in a folder of its own, beside the folder recordings (docs/formats.md).
format_version: 1
name: {title}
wing:
  name: {title}
  # x aft, y outboard, z up, in metres; {origin}
  stations:
"""
_WITHOUT_RODS = """\
  structure: {structure}
  # Areal density = foam density (of what fills the thickness) * thickness + that of the skin; one of the two may be 0
  materials:
    foam_density_kg_m3: 0
    skin_areal_density_kg_m2: {skin}
"""
_REST = """\
  materials:
    foam_density_kg_m3: {foam}
    skin_areal_density_kg_m2: {skin}
  # At least two rods, each like this one, straight from root to tip:
  # - {{name: front, x_root_m: 0.01, y_root_m: 0, x_tip_m: 0.02, y_tip_m: 0.2, diameter_m: 0.002,
  #    density_kg_m3: 1600, glue_linear_density_kg_m: 0.003}}
  rods: {rods}
  driven_rods: {driven}
"""
_TAIL = """\
  reference_markers: {reference}
  hinge: {{y_m: {hinge_y}, z_m: {hinge_z}}}
  # For example {{kind: fourier, mean_deg: 5, cosine_deg: [0], sine_deg: [30]}}; or a four-bar linkage
  drive: {drive}
# One line like this for each recording. Its tracks are the table recordings/NAME.csv beside this file, as
# "wingfit import TRACKS --axes 'x aft, y out, z up' -o NAME.csv" writes it, with the names of the markers above.
recordings:
  - {{name: first, rig: {rig}, flap_frequency_hz: {frequency}, phase_lag_deg: {lag},
     pressure_mbar: {pressure}, temperature_c: {temperature}, airspeed_m_s: 0}}
"""


def description(
    file: str,
    title: str,
    sections: Sections,
    hinge: tuple[float, float],
    area: float,
    markers: Sequence[PlacedMarker],
    options: OutlineOptions,
) -> str:
    """Return the text of ``dataset.yaml``; ``hinge`` is the place (y, z) of the flapping axis, m; ``area`` in m^2."""
    origin = "zero where --origin says" if options.origin else "zero at the leading edge of the root end"
    parts = [_HEAD.format(file=" ".join(file.split()), title=json.dumps(title, ensure_ascii=False), origin=origin)]
    parts += _stations(sections, options)
    parts.append(_structure(area, options))
    parts.append(_markers(markers))
    parts.append(
        _TAIL.format(
            reference=_blank("list of the markers near the root that show the start of a beat"),
            hinge_y=_number(hinge[0], 12),
            hinge_z=_number(hinge[1], 12),
            drive=_blank("drive of the wing, a mapping with its kind"),
            rig=_blank("rig, vacuum_chamber or wind_tunnel"),
            frequency=_blank("flap frequency, Hz"),
            lag="0" if options.structure else _blank("phase lag of the rear rod, deg"),
            pressure=_blank("pressure, mbar, such as 1013"),
            temperature=_blank("temperature, deg C, such as 20"),
        )
    )
    return "".join(parts)


def _structure(area: float, options: OutlineOptions) -> str:
    if options.structure is not None:
        mean = _blank("mean areal density of the wing, its mass / area, kg/m^2")
        skin = mean if options.mass_g is None else f"{options.mass_g * 1e-3 / area:.6g}"
        return _WITHOUT_RODS.format(structure=options.structure, skin=skin)
    return _REST.format(
        foam=_blank("density of the foam, kg/m^3"),
        skin=_blank("areal density of the skin with its glue, both faces together, kg/m^2"),
        rods=_blank("list of at least two rods"),
        driven=_blank("list of two rods that the drive turns, the front and the rear one: [front, rear]"),
    )


def _stations(sections: Sections, options: OutlineOptions) -> list[str]:
    thickness = [_blank("thickness here, m")] * len(sections.y)
    if options.thickness_mm:
        ends = sections.y[[0, -1]]
        thickness = [_number(one, 9) for one in np.interp(sections.y, ends, np.array(options.thickness_mm) * 1e-3)]
    rows = zip(sections.y, sections.leading, sections.chord, thickness, strict=True)
    places = sections.decimals
    return [
        f"    - {{y_m: {_number(y, places)}, leading_edge_m: {_number(edge, places)}, "
        f"chord_m: {_number(chord, places)}, thickness_m: {thick}}}\n"
        for y, edge, chord, thick in rows
    ]


def _markers(markers: Sequence[PlacedMarker]) -> str:
    if not markers:
        return f"  markers: {_blank('list of tracked markers')}\n"
    lines = []
    for one in markers:
        z = _blank("height above the plane of the wing, m") if one.z is None else _number(one.z, 12)
        mass = _blank("mass of this marker, kg") if one.mass is None else _number(one.mass, 12)
        place = f"x_m: {_number(one.x, 12)}, y_m: {_number(one.y, 12)}, z_m: {z}"
        lines.append(f"    - {{name: {json.dumps(one.name, ensure_ascii=False)}, {place}, mass_kg: {mass}}}\n")
    return "  markers:\n" + "".join(lines)


def _blank(what: str) -> str:
    return json.dumps(placeholder(what))


def _number(value: float, decimals: int) -> str:
    """Return ``value`` rounded to ``decimals``, without an exponent and without zeros at the end."""
    text = f"{value + 0.0:.{decimals}f}".rstrip("0").rstrip(".")
    return "0" if text in ("", "-0") else text
