"""Adds the notes that users write on datasets, runs and diagnoses."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"

TABLES = ("dataset", "run", "diagnosis")


def upgrade() -> None:
    """Add the column; what is there has no notes yet."""
    for table in TABLES:
        op.add_column(table, sa.Column("notes", sa.String, nullable=False, server_default=""))
