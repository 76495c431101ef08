"""Adds the number of starts of each job, the internal format of NetCDF datasets, and the service clock."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"

JOBS = ("run", "diagnosis")


def upgrade() -> None:
    """Add the columns and tables; existing jobs get zero starts and no end time of the service clock (NULL) yet."""
    for table in JOBS:
        op.add_column(table, sa.Column("starts", sa.Integer, nullable=False, server_default="0"))
        op.add_column(table, sa.Column("ended_at_service_seconds", sa.Double))
    op.create_table(
        "parsed",
        sa.Column("dataset_id", sa.String, sa.ForeignKey("dataset.id", ondelete="CASCADE"), primary_key=True),
        sa.Column("body", sa.LargeBinary, nullable=False),
    )
    op.create_table(
        "clock",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("service_seconds", sa.Double, nullable=False),
        sa.Column("wall_time", sa.String, nullable=False),
    )
