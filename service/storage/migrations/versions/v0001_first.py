"""First schema: datasets, runs with their checkpoints and history, answers to repeated requests."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None


def upgrade() -> None:
    """Create the tables of the first schema."""
    _datasets()
    _runs()
    op.create_table(
        "answer",
        sa.Column("path", sa.String, primary_key=True),
        sa.Column("key", sa.String, primary_key=True),
        sa.Column("fingerprint", sa.String, nullable=False),
        sa.Column("status", sa.Integer, nullable=False),
        sa.Column("location", sa.String, nullable=False),
        sa.Column("body", sa.JSON, nullable=False),
        sa.Column("created_at", sa.String, nullable=False),
    )


def _datasets() -> None:
    op.create_table(
        "dataset",
        sa.Column("number", sa.Integer, primary_key=True),
        sa.Column("id", sa.String, nullable=False, unique=True),
        sa.Column("name", sa.String, nullable=False),
        sa.Column("description", sa.String, nullable=False),
        sa.Column("filename", sa.String, nullable=False),
        sa.Column("created_at", sa.String, nullable=False),
        sa.Column("sha256", sa.String, nullable=False),
        sa.Column("size_bytes", sa.Integer, nullable=False),
        sa.Column("markers", sa.Integer, nullable=False),
        sa.Column("recordings", sa.JSON, nullable=False),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "archive",
        sa.Column("dataset_id", sa.String, sa.ForeignKey("dataset.id", ondelete="CASCADE"), primary_key=True),
        sa.Column("body", sa.LargeBinary, nullable=False),
    )


def _runs() -> None:
    op.create_table(
        "run",
        sa.Column("number", sa.Integer, primary_key=True),
        sa.Column("id", sa.String, nullable=False, unique=True),
        sa.Column("name", sa.String, nullable=False),
        sa.Column(
            "dataset_id", sa.String, sa.ForeignKey("dataset.id", ondelete="RESTRICT"), nullable=False, index=True
        ),
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
        sa.Column("best_mm", sa.Double),
        sa.Column("error", sa.String),
        sa.Column("genome", sa.JSON),
        sa.Column("result", sa.JSON),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "checkpoint",
        sa.Column("run_id", sa.String, sa.ForeignKey("run.id", ondelete="CASCADE"), primary_key=True),
        sa.Column("body", sa.JSON, nullable=False),
    )
    op.create_table(
        "generation",
        sa.Column("run_id", sa.String, sa.ForeignKey("run.id", ondelete="CASCADE"), primary_key=True),
        sa.Column("sequence", sa.Integer, primary_key=True),
        sa.Column("stage", sa.String, nullable=False),
        sa.Column("generation", sa.Integer, nullable=False),
        sa.Column("best", sa.Double),
        sa.Column("mean", sa.Double),
        sa.Column("diversity", sa.Double),
        sa.Column("best_mm", sa.Double),
        sa.Column("evaluations", sa.Integer, nullable=False),
        sa.Column("failed", sa.Integer, nullable=False),
        sa.Column("reasons", sa.JSON, nullable=False),
        sa.Column("elapsed_seconds", sa.Double, nullable=False),
        sa.Column("progress", sa.Double, nullable=False),
        sa.Column("eta_seconds", sa.Double),
    )
