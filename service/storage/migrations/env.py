"""Runs the migrations on the connection that the service hands over."""

from __future__ import annotations

from alembic import context

from wingfit.service.storage.tables import Table

context.configure(
    connection=context.config.attributes["connection"], target_metadata=Table.metadata, render_as_batch=True
)
with context.begin_transaction():
    context.run_migrations()
