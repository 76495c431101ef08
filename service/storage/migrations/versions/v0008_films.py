"""Adds films and the tracking of their markers: the films, the jobs, their steps and results."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"


def upgrade() -> None:
    """Create the tables of films, trackings, their steps and results."""
    op.create_table(
        "film",
        *_owned(),
        sa.Column("cameras", sa.JSON, nullable=False),
        sa.Column("calibration", sa.String),
        sa.Column("size_bytes", sa.Integer, nullable=False),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "tracking",
        *_owned(),
        sa.Column("film_id", sa.String, sa.ForeignKey("film.id", ondelete="RESTRICT"), nullable=False, index=True),
        sa.Column("dataset_id", sa.String),
        sa.Column("spec", sa.JSON, nullable=False),
        sa.Column("state", sa.String, nullable=False, index=True),
        sa.Column("wish", sa.String, nullable=False),
        sa.Column("stage", sa.String),
        sa.Column("progress", sa.Double, nullable=False),
        sa.Column("eta_seconds", sa.Double),
        sa.Column("started_at", sa.String),
        sa.Column("finished_at", sa.String),
        sa.Column("generations", sa.Integer, nullable=False),
        sa.Column("elapsed_seconds", sa.Double, nullable=False),
        sa.Column("error", sa.String),
        sa.Column("starts", sa.Integer, nullable=False),
        sa.Column("ended_at_service_seconds", sa.Double),
        sqlite_autoincrement=True,
    )
    _belonging("tracked", sa.Column("body", sa.JSON, nullable=False))
    _belonging(
        "tracking_step",
        sa.Column("sequence", sa.Integer, primary_key=True),
        sa.Column("stage", sa.String, nullable=False),
        sa.Column("progress", sa.Double, nullable=False),
        sa.Column("elapsed_seconds", sa.Double, nullable=False),
        sa.Column("eta_seconds", sa.Double),
    )


def _owned() -> list[sa.Column[object]]:
    """Return the columns of what has an owner."""
    return [
        sa.Column("number", sa.Integer, primary_key=True),
        sa.Column("id", sa.String, nullable=False, unique=True),
        sa.Column("owner", sa.String, index=True),
        sa.Column("name", sa.String, nullable=False),
        sa.Column("created_at", sa.String, nullable=False),
    ]


def _belonging(table: str, *columns: sa.Column[object]) -> None:
    """Create ``table``, with these further ``columns``, whose rows are deleted together with their tracking."""
    owner = sa.ForeignKey("tracking.id", ondelete="CASCADE")
    op.create_table(table, sa.Column("tracking_id", sa.String, owner, primary_key=True), *columns)
