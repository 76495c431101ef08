"""Runs the database migrations (Alembic executes this file), on the connection that `database.migrate` sets."""

from __future__ import annotations

from alembic import context

from wingfit.service.storage.tables import Table

context.configure(
    connection=context.config.attributes["connection"], target_metadata=Table.metadata, render_as_batch=True
)
with context.begin_transaction():
    context.run_migrations()
