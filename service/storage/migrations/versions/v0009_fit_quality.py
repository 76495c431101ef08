"""Adds misfits as multiples of the noise to runs and diagnoses, and what a running diagnosis knows so far."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"

COLUMNS = ("residual_over_noise", "held_out_over_noise")
Misfits = tuple[float | None, float | None]


def upgrade() -> None:
    """Add the columns, filled for the jobs that have ended, and the table of partial findings."""
    op.create_table(
        "partial",
        sa.Column("diagnosis_id", sa.String, sa.ForeignKey("diagnosis.id", ondelete="CASCADE"), primary_key=True),
        sa.Column("body", sa.JSON, nullable=False),
    )
    for table in ("run", "diagnosis"):
        for column in COLUMNS:
            op.add_column(table, sa.Column(column, sa.Double))
    _fill("run", "SELECT id, kind, result FROM run WHERE result IS NOT NULL", _of_run)
    _fill("diagnosis", "SELECT diagnosis_id, '', body FROM finding", _of_finding)


def _fill(table: str, select: str, misfits: Callable[[str, dict[str, Any]], Misfits]) -> None:
    connection, jobs = op.get_bind(), sa.table(table, sa.column("id"), *(sa.column(name) for name in COLUMNS))
    for identity, kind, body in connection.execute(sa.text(select)).all():
        found = dict(zip(COLUMNS, misfits(kind, json.loads(body)), strict=True))
        connection.execute(jobs.update().where(jobs.c.id == identity).values(found))


def _of_run(kind: str, result: dict[str, Any]) -> Misfits:
    if kind == "series":
        known = result.get("relative_to") == "noise"
        return (result["after"], result["held_out_after"]) if known else (None, None)
    noise = result.get("noise_mm")  # results on forces did not have it
    if not noise:
        return None, None
    after, held_out = result["after_mm"], result["held_out_after_mm"]
    return after / noise, None if held_out is None else held_out / noise


def _of_finding(_kind: str, finding: dict[str, Any]) -> Misfits:
    ratios = [
        one["after"]["value"] / one["floor"] for one in finding["recordings"] if not one["held_out"] and one["floor"]
    ]
    fitted = math.sqrt(sum(one**2 for one in ratios) / len(ratios)) if ratios else None
    return fitted, finding["proof"]["after"]["value"] if finding["proof"] else None
