"""Writes the loads of a simulated wing as CSV, JSON or a page of plots, and summarises them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

from wingfit.cli.base.files import write_csv, write_text
from wingfit.cli.base.output import number
from wingfit.client import load_answers as a
from wingfit.client.answers import Numerics

AXES = "xyz"
SECTIONS_SHOWN = 6  # of the bending moment: more curves cannot be distinguished
VECTORS = {
    "moment_n_m": "moment_{}_n_m",
    "force_n": "force_{}_n",
    "angular_velocity_rad_s": "angular_velocity_{}_rad_s",
    "velocity_m_s": "velocity_{}_m_s",
}
Column = tuple[str, list[float]]


def write_loads(outputs: a.Outputs, path: Path) -> None:
    """Write ``outputs`` to ``path``: a .json file as the server sends it, else CSV, one row per instant of the beat."""
    if path.suffix.lower() == ".json":
        write_text(path, json.dumps(outputs) + "\n", "loads")
        return
    # The power of the motors is listed twice under one name, with the motors and with the ports: one column.
    table = dict(columns(outputs))
    write_csv(path, table, zip(*table.values(), strict=True), "loads")


def write_plot(outputs: a.Outputs, path: Path, title: str) -> None:
    """Write an HTML page that plots torques, powers, forces, bending moments and energies over the beat."""
    from wingfit.report.charts import Chart, Curve, chart_page  # drawn only where a plot was requested

    stride = -(-len(outputs["sections"]) // SECTIONS_SHOWN)
    power = [(name.replace("_", " "), series) for name, series in outputs["power_w"].items()]
    shown: list[tuple[str, str, list[Column]]] = [
        ("Motor torque", "N m", [(k, outputs["motor_torque_n_m"][k]) for k in ("front", "rear")]),
        ("Power into the wing", "W", power),
        ("Aerodynamic force", "N", [("lift", outputs["lift_n"]), ("thrust", outputs["thrust_n"])]),
        ("Bending moment", "N m", [_bending(section) for section in outputs["sections"][::stride]]),
        ("Energy", "J", [(k, outputs["energy_j"][k]) for k in ("kinetic", "elastic", "gravitational")]),
    ]
    charts = [
        Chart(name, "phase of the beat", unit, [Curve(label, outputs["phase"], values) for label, values in series])
        for name, unit, series in shown
    ]
    write_text(path, chart_page(title, charts), "plots")


def summary(outputs: a.Outputs) -> list[list[str]]:
    """Return the averages over the beat as rows of a table: [quantity, value with unit]."""
    means = outputs["averages"]
    torque, power = means["peak_motor_torque_n_m"], means["motor_power_w"]
    rows = [
        ("mean lift", f"{means['lift_n']:.4g} N"),
        ("mean thrust", f"{means['thrust_n']:.4g} N"),
        ("front motor", f"{power['front']:.4g} W, peak torque {torque['front']:.4g} N m"),
        ("rear motor", f"{power['rear']:.4g} W, peak torque {torque['rear']:.4g} N m"),
        ("dissipated in the wing", f"{means['dissipated_w']:.4g} W"),
        ("transferred to the air", f"{means['to_air_w']:.4g} W"),
        (
            "closing error",
            f"{means['closing_error_w']:.2g} W, {means['closing_error_percent']:.2g} % of the power entering the wing",
        ),
    ]
    if "numerics" in outputs:
        rows.append(("solved with", accuracy(outputs["numerics"])))
    return [list(row) for row in rows]


def accuracy(numerics: Numerics | a.OutputNumerics) -> str:
    """Return time steps per beat and estimated error of a simulation as text."""
    error = number(numerics["estimated_error_mm"], 2)
    return f"{numerics['steps_per_beat']} steps per beat, estimated error {error} mm"


def columns(outputs: a.Outputs) -> Iterator[Column]:
    """Yield (name, values over the beat) for every time series in ``outputs``; vectors give one column per component.

    A name ends with the unit.
    """
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
