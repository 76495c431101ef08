"""Adds the table of API keys, and the owners of datasets and jobs."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"

OWNED = ("dataset", "run", "diagnosis")


def upgrade() -> None:
    """Create the table of keys; existing datasets and jobs get no owner, so only administrators see them."""
    op.create_table(
        "key",
        sa.Column("number", sa.Integer, primary_key=True),
        sa.Column("id", sa.String, nullable=False, unique=True),
        sa.Column("name", sa.String, nullable=False),
        sa.Column("owner", sa.String, nullable=False),
        sa.Column("scopes", sa.JSON, nullable=False),
        sa.Column("sha256", sa.String, nullable=False, unique=True),
        sa.Column("created_at", sa.String, nullable=False),
        sa.Column("revoked_at", sa.String),
        sqlite_autoincrement=True,
    )
    for table in OWNED:
        op.add_column(table, sa.Column("owner", sa.String))
        op.create_index(f"ix_{table}_owner", table, ["owner"])
