"""Exports of a run: its history as a CSV table, or the whole run as one JSON document.

Both are made piece by piece while they are sent, from ``BLOCK`` generations at a time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

from pydantic_core import to_json

from wingfit.client.answers import HistoryItem
from wingfit.client.export_answers import Export, RunExport
from wingfit.service.answers import checked
from wingfit.service.container import Service
from wingfit.service.http import csv_text
from wingfit.service.outcomes import force_views
from wingfit.service.rigs.stored_rig import requested
from wingfit.service.runs import best_genome, views
from wingfit.service.storage import store
from wingfit.service.storage.database import Database
from wingfit.service.storage.tables import DatasetRow, DiagnosisRow, GenerationRow, RunRow
from wingfit.service.version import wingfit_version

AnyJob = TypeVar("AnyJob", RunRow, DiagnosisRow)
BLOCK = 1000
# Columns of the table, by the fields of a generation; the first two are squares of the unit of the run's kind.
SQUARES = ("best", "mean")
COLUMNS = ("sequence", "stage", "generation", *SQUARES, "diversity")
MORE_COLUMNS = ("evaluations", "failed", "reasons", "elapsed_seconds")


@dataclass(frozen=True)
class Exported(Generic[AnyJob]):
    """The database rows of a run or diagnosis and of its dataset, read at the time ``at`` (RFC 3339, UTC)."""

    row: AnyJob
    dataset: DatasetRow
    at: str

    def heading(self, schema: str) -> Export:
        """Return the fields that all exports share; ``schema``: kind of export, e.g. "run-export"."""
        return Export(
            schema_id=f"urn:wingfit:schema:{schema}:1",
            wingfit_version=wingfit_version(),
            exported_at=self.at,
            dataset=views.dataset(self.dataset),
        )


def of(service: Service, table: type[AnyJob], job_id: str) -> Exported[AnyJob]:
    """Return the job of ``table`` with id ``job_id`` and its dataset, as they are now; raise a 404 if there is none."""
    with service.database.read() as session:
        row = store.one(session, table, job_id)
        return Exported(row, store.one(session, DatasetRow, row.dataset_id), store.now())


def blocks(database: Database, row: RunRow) -> Iterator[list[GenerationRow]]:
    """Yield the generations of the run ``row``, ascending, in lists of up to ``BLOCK``; each is a separate short read.

    Raises a 404 if the run is deleted meanwhile; the client then sees that the answer is incomplete.
    """
    for after in range(0, row.generations, BLOCK):
        with database.read() as session:
            store.one(session, RunRow, row.id)
            found = store.steps(session, GenerationRow, row.id, after, min(BLOCK, row.generations - after))
        yield found


def table(database: Database, row: RunRow) -> Iterator[str]:
    """Yield the history as CSV text, one generation per line; the names of columns with a unit end in the unit."""
    square, misfit = {"tracks": ("_m2", "best_mm"), "forces": ("_n2", "best_mn")}.get(row.kind, ("", "best_percent"))
    fields = (*COLUMNS, misfit, *MORE_COLUMNS)
    yield csv_text.lines([[f"{name}{square}" if name in SQUARES else name for name in fields]])
    for block in blocks(database, row):
        yield csv_text.lines([[_cell(one, name) for name in fields] for one in block])


def document(service: Service, exported: Exported[RunRow]) -> Iterator[str]:
    """Return the whole run as JSON (a RunExport) in pieces of text.

    The head, which needs the dataset, is computed before this function returns; the history while it is sent.
    """
    row = exported.row
    without_history = RunExport(
        **exported.heading("run-export"),
        run=views.run(row),
        request=request(row),
        genome=None if row.genome is None else best_genome.standing(service, row),
        result=None if row.result is None else force_views.stored(row.kind, row.result),
        history=[],
    )
    return _filled(service.database, row, to_json(without_history).decode().removesuffix("]}"))


def _filled(database: Database, row: RunRow, head: str) -> Iterator[str]:
    yield head
    for number, block in enumerate(blocks(database, row)):
        items = ",\n".join(to_json(checked(HistoryItem, views.columns(one))).decode() for one in block)
        yield f",\n{items}" if number else items
    yield "]}\n"


def request(row: RunRow) -> dict[str, object]:
    """Return the body of POST /v1/runs that submits the same run again."""
    run = views.run(row)
    again = {"dataset_id": run["dataset_id"], "name": run["name"], **run["spec"]}
    return again if row.rig is None else again | {"rig": requested(row.rig)}


def _cell(generation: GenerationRow, name: str) -> csv_text.Cell:
    value: csv_text.Cell = "; ".join(generation.reasons) if name == "reasons" else getattr(generation, name)
    return value
