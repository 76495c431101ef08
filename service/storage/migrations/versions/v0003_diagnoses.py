"""Adds the tables of diagnoses: the jobs, their progress and findings."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    """Create the tables of diagnoses, findings and steps."""
    op.create_table(
        "diagnosis",
        sa.Column("number", sa.Integer, primary_key=True),
        sa.Column("id", sa.String, nullable=False, unique=True),
        sa.Column("name", sa.String, nullable=False),
        sa.Column(
            "dataset_id", sa.String, sa.ForeignKey("dataset.id", ondelete="RESTRICT"), nullable=False, index=True
        ),
        sa.Column("run_id", sa.String, sa.ForeignKey("run.id", ondelete="SET NULL"), index=True),
        sa.Column("kind", sa.String, nullable=False, server_default="tracks"),
        sa.Column("spec", sa.JSON, nullable=False),
        sa.Column("state", sa.String, nullable=False, index=True),
        sa.Column("wish", sa.String, nullable=False),
        sa.Column("stage", sa.String),
        sa.Column("progress", sa.Double, nullable=False),
        sa.Column("eta_seconds", sa.Double),
        sa.Column("created_at", sa.String, nullable=False),
        sa.Column("started_at", sa.String),
        sa.Column("finished_at", sa.String),
        sa.Column("generations", sa.Integer, nullable=False),
        sa.Column("evaluations", sa.Integer, nullable=False),
        sa.Column("elapsed_seconds", sa.Double, nullable=False),
        sa.Column("error", sa.String),
        sa.Column("verdict", sa.String),
        sa.Column("summary", sa.String),
        sqlite_autoincrement=True,
    )
    _belonging("finding", sa.Column("body", sa.JSON, nullable=False))
    _belonging(
        "step",
        sa.Column("sequence", sa.Integer, primary_key=True),
        sa.Column("stage", sa.String, nullable=False),
        sa.Column("progress", sa.Double, nullable=False),
        sa.Column("evaluations", sa.Integer, nullable=False),
        sa.Column("elapsed_seconds", sa.Double, nullable=False),
        sa.Column("eta_seconds", sa.Double),
    )


def _belonging(table: str, *columns: sa.Column[object]) -> None:
    """Create ``table``, with these further ``columns``, whose rows are deleted together with their diagnosis."""
    owner = sa.ForeignKey("diagnosis.id", ondelete="CASCADE")
    op.create_table(table, sa.Column("diagnosis_id", sa.String, owner, primary_key=True), *columns)
