"""The described wing and the checks of a dataset as the API's JSON answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np

from wingfit.checks import CHECKS
from wingfit.client.answers import Kind
from wingfit.client.recorded import answers as a
from wingfit.records import Dataset, FrameError
from wingfit.records.array_types import Array, ArrayLike
from wingfit.records.description.wing_plan import plan_of
from wingfit.service.units import MM, mm
from wingfit.sim.wing.drive import RodDrive

DRIVE_PHASES = 72  # of the described flap angle
DECIMALS = 3  # of positions in mm


def described_wing(dataset: Dataset) -> a.DescribedWing:
    """Return the wing of a ``dataset`` of tracks; ValueError if it describes a vehicle."""
    wing = dataset.wing
    plan = plan_of(wing)
    leading = [(edge, y, 0.0) for y, edge, _ in plan.stations]
    trailing = [(edge + chord, y, 0.0) for y, edge, chord in reversed(plan.stations)]
    angles = RodDrive.of(wing.drive, 0.0, 1).angles(2 * np.pi * np.arange(DRIVE_PHASES) / DRIVE_PHASES)[:, 0, 0, 0]
    frame = dataset.frame_error
    return {
        "name": wing.name,
        "span_mm": wing.span * MM,
        "outline_mm": points_mm([*leading, *trailing, leading[0]]),
        "rods": [
            {
                "name": name,
                "root_mm": point_mm((x_root, y_root, 0.0)),
                "tip_mm": point_mm((x_tip, y_tip, 0.0)),
                "driven": name in wing.driven_rods,
            }
            for name, x_root, y_root, x_tip, y_tip in plan.rods
        ],
        "markers": [
            {"name": one.name, "position_mm": point_mm(one.position), "reference": one.name in wing.reference_markers}
            for one in wing.markers
        ],
        "hinge_mm": point_mm((0.0, wing.hinge.y, wing.hinge.z)),
        "drive_deg": np.round(np.degrees(angles), DECIMALS).tolist(),
        "frame_error": None if frame is None else _frame_error(frame),
        "cameras": [{"name": one.name, "centre_mm": point_mm(one.centre)} for one in dataset.cameras],
    }


def _frame_error(frame: FrameError) -> a.FrameErrors:
    return {"rotation_deg": np.degrees(frame.rotation).tolist(), "origin_mm": [mm(one) for one in frame.origin]}


def point_mm(position: Sequence[float]) -> list[float | None]:
    """Return one ``position`` (m) in mm."""
    (point,) = points_mm([position])
    return [*point]


def points_mm(positions: ArrayLike) -> list[Any]:
    """Return ``positions`` [..., 3] (m) as nested lists in mm; None where a coordinate is missing."""
    rounded: Array = np.round(np.asarray(positions, float) * MM, DECIMALS) + 0.0
    nested: list[Any] = np.where(np.isfinite(rounded), rounded, None).tolist()  # type: ignore[call-overload]
    return nested


def checks(kind: str, warnings: Sequence[Mapping[str, Any]] | None) -> a.Checks:
    """Return the checks of this ``kind`` of dataset, and how many of the ``warnings`` each found; None: not made."""
    found = [one["kind"] for one in warnings or ()]
    return {
        "kind": cast(Kind, kind),
        "carried_out": warnings is not None,
        "checks": [
            {"name": one.name, "question": one.question, "found": sum(word in one.finds for word in found)}
            for one in CHECKS
            if kind in one.of
        ],
    }
