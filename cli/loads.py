"""Loads of a simulation as files: CSV, JSON, and a page of plots."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, cast

from wingfit.cli.base.files import write_csv, write_text
from wingfit.cli.base.output import number
from wingfit.client import load_answers as a

AXES = "xyz"
VECTORS = {
    "moment_n_m": "moment_{}_n_m",
    "force_n": "force_{}_n",
    "angular_velocity_rad_s": "angular_velocity_{}_rad_s",
    "velocity_m_s": "velocity_{}_m_s",
}
# A colour for each series of a panel, told apart in grey and by the colour-blind (Okabe and Ito 2008).
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")

Column = tuple[str, list[float]]
Panel = tuple[str, list[Column]]


PORTS: tuple[tuple[Literal["front_motor", "rear_motor", "air", "dampers"], str], ...] = (
    ("front_motor", "front motor"),
    ("rear_motor", "rear motor"),
    ("air", "air"),
    ("dampers", "dampers"),
)


def write_loads(outputs: a.Outputs, path: Path) -> None:
    """Write JSON as the server answers it, or CSV: a row per instant, a column per series."""
    if path.suffix.lower() == ".json":
        write_text(path, json.dumps(outputs) + "\n")
        return
    # The motors' power is among theirs and among the ports', under one name: one column.
    table = dict(columns(outputs))
    write_csv(path, table, zip(*table.values(), strict=True))


def write_plot(outputs: a.Outputs, path: Path, title: str) -> None:
    """Write a page that needs nothing else: torques, powers, forces, bending moments and energies over the beat."""
    from plotly import graph_objects
    from plotly.subplots import make_subplots

    shown = panels(outputs)
    figure = make_subplots(rows=len(shown), cols=1, shared_xaxes=True, vertical_spacing=0.035)
    for row, (axis, columns) in enumerate(shown, 1):
        for k, (name, values) in enumerate(columns):
            line = graph_objects.Scatter(
                x=outputs["phase"],
                y=values,
                name=name,
                line={"width": 2, "simplify": False, "color": COLOURS[k % len(COLOURS)]},
                legend=f"legend{row}" if row > 1 else "legend",
            )
            figure.add_trace(line, row=row, col=1)
        figure.update_yaxes(title_text=axis, row=row, col=1)
        top = figure.layout[f"yaxis{row if row > 1 else ''}"].domain[1]
        figure.update_layout({f"legend{row if row > 1 else ''}": {"y": top, "yanchor": "top", "x": 1.01}})
    figure.update_xaxes(title_text="phase of the beat", row=len(shown), col=1)
    figure.update_layout(title=title, height=290 * len(shown), template="plotly_white", hovermode="x unified")
    write_text(path, figure.to_html(include_plotlyjs=True))


def panels(outputs: a.Outputs) -> list[Panel]:
    """What is drawn: axis title and series of each panel."""
    stride = -(-len(outputs["sections"]) // len(COLOURS))
    return [
        ("motor torque, N m", [(k, outputs["motor_torque_n_m"][k]) for k in ("front", "rear")]),
        ("power into the wing, W", [(name, outputs["power_w"][key]) for key, name in PORTS]),
        ("force of the air, N", [("lift", outputs["lift_n"]), ("thrust", outputs["thrust_n"])]),
        ("bending moment, N m", [_bending(section) for section in outputs["sections"][::stride]]),
        ("energy, J", [(k, outputs["energy_j"][k]) for k in ("kinetic", "elastic", "gravitational")]),
    ]


def summary(outputs: a.Outputs) -> list[list[str]]:
    """Averages over the beat as rows of a table."""
    means = outputs["averages"]
    torque, power = means["peak_motor_torque_n_m"], means["motor_power_w"]
    rows = [
        ("mean lift", f"{means['lift_n']:.4g} N"),
        ("mean thrust", f"{means['thrust_n']:.4g} N"),
        ("front motor", f"{power['front']:.4g} W, peak torque {torque['front']:.4g} N m"),
        ("rear motor", f"{power['rear']:.4g} W, peak torque {torque['rear']:.4g} N m"),
        ("dissipated in the wing", f"{means['dissipated_w']:.4g} W"),
        ("given to the air", f"{means['to_air_w']:.4g} W"),
        ("closing error", f"{means['closing_error_w']:.2g} W, {means['closing_error_percent']:.2g} % of what enters"),
    ]
    if "numerics" in outputs:
        solved = outputs["numerics"]
        error = number(solved["estimated_error_mm"], 2)
        rows.append(("solved with", f"{solved['steps_per_beat']} steps a beat, estimated error {error} mm"))
    return [list(row) for row in rows]


def columns(outputs: a.Outputs) -> Iterator[Column]:
    """Every series with a name of its own, units last; vectors by component."""
    for key, value in outputs.items():
        if key in ("averages", "numerics"):
            continue
        if isinstance(value, dict):
            yield from ((f"{name}_{key}", series) for name, series in value.items())
        elif key in ("strips", "sections", "connectors"):
            for part in cast(list[dict[str, Any]], value):
                yield from _of_part(key, part)
        else:
            yield key, cast(list[float], value)


def _of_part(key: str, part: dict[str, Any]) -> Iterator[Column]:
    name = str(part["name"]).replace(" ", "_")
    prefix = f"section_{name}" if key == "sections" else name
    for quantity, series in part.items():
        if quantity in VECTORS:
            for k, axis in enumerate(AXES):
                yield f"{prefix}_{VECTORS[quantity].format(axis)}", [row[k] for row in series]
        elif quantity in ("lift_n", "thrust_n", "side_n", "power_w", "dissipated_w", "stored_j"):
            yield f"{prefix}_{quantity}", series


def _bending(section: a.SectionLoad) -> Column:
    name = "root" if section["name"] == "root" else f"at {section['span_mm']:.0f} mm"
    return name, [moment[0] for moment in section["moment_n_m"]]
