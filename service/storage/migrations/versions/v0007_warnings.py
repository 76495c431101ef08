"""Adds the likely mistakes that the checks found in a dataset at its upload."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"


def upgrade() -> None:
    """Add the column; datasets of before were not checked (NULL)."""
    op.add_column("dataset", sa.Column("warnings", sa.JSON))
