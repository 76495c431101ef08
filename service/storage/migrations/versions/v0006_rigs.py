"""Adds what rigs of the user's own need: the rig of a dataset and of a job, misfits in percent, and simulations."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"


def upgrade() -> None:
    """Add the columns and the table; existing datasets and jobs have no rig of the user's own (NULL)."""
    for table in ("dataset", "run", "diagnosis"):
        op.add_column(table, sa.Column("rig", sa.JSON))
    for table in ("run", "diagnosis"):
        op.add_column(table, sa.Column("rig_name", sa.String))
        op.add_column(table, sa.Column("driven", sa.Boolean, nullable=False, server_default="0"))
    for table in ("run", "generation"):
        op.add_column(table, sa.Column("best_percent", sa.Double))
    op.create_table(
        "simulated",
        sa.Column("job_id", sa.String, primary_key=True),
        sa.Column("key", sa.String, primary_key=True),
        sa.Column("channels", sa.LargeBinary),
        sa.Column("reason", sa.String),
    )
