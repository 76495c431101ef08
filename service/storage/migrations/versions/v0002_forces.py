"""Adds what force recordings need: the kind of a dataset and of a run, and misfits in mN beside those in mm."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Add the columns; existing datasets and runs get the kind "tracks"."""
    for table in ("dataset", "run"):
        op.add_column(table, sa.Column("kind", sa.String, nullable=False, server_default="tracks"))
    for table in ("run", "generation"):
        op.add_column(table, sa.Column("best_mn", sa.Double))
