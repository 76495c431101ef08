"""Checks that the server can read every dataset, film and job of a restored database, which is not trusted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from wingfit.service.diagnoses import views as diagnosis_views
from wingfit.service.films import views as film_views
from wingfit.service.films.files import FilmFiles
from wingfit.service.runs import views
from wingfit.service.storage import store
from wingfit.service.storage.database import Database
from wingfit.service.storage.tables import ClockRow, DatasetRow, DiagnosisRow, FilmRow, RunRow, TrackingRow

Table = type[DatasetRow] | type[RunRow] | type[DiagnosisRow] | type[FilmRow] | type[TrackingRow]
LONGEST_CAUSE = 200
FILES = FilmFiles(Path())  # checks the names of films and their files; a backup has no files


class RowError(ValueError):
    """Raised for a row that the server cannot read; the message says which row and why."""


def check_rows(database: Database) -> None:
    """Read each row as the server does for its lists and at its start; raise RowError for the first unreadable row."""
    with database.read() as session:
        for table, read in _READERS.items():
            for number in session.scalars(select(table.number).order_by(table.number)).all():
                _check(session, table, number, read)
                session.expunge_all()
        for clock in session.scalars(select(ClockRow)):
            if not isinstance(clock.service_seconds, int | float):
                raise RowError(f"the clock in it stands at {clock.service_seconds!a}, which is no number of seconds")


def _check(session: Session, table: Table, number: int, read: Callable[[Any], object]) -> None:
    try:
        read(session.get_one(table, number))
    except Exception as error:  # the values may be anything
        cause = " ".join(str(error).split())[:LONGEST_CAUSE]
        raise RowError(
            f"row {number} of its table {table.__tablename__!r} cannot be read ({type(error).__name__}: {cause!a})"
        ) from None


_READERS: dict[Table, Callable[[Any], object]] = {
    DatasetRow: views.dataset,
    RunRow: lambda row: (views.run(row), store.job(row)),
    DiagnosisRow: lambda row: (diagnosis_views.diagnosis(row), store.job(row)),
    FilmRow: lambda row: film_views.film(row, FILES),
    TrackingRow: lambda row: (film_views.tracking(row), store.job(row), FILES.tracked(row.film_id, row.id)),
}
