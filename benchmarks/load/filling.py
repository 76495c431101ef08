"""Fills a server's database as years of use would, with copies of a run that the server computed and stored."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from sqlalchemy import func, insert, literal, select
from sqlalchemy.orm import Session

from wingfit.service.runs.views import columns
from wingfit.service.storage import store
from wingfit.service.storage.database import Database
from wingfit.service.storage.tables import ArchiveRow, DatasetRow, GenerationRow, RunRow
from wingfit.workers.jobs import State

Values = dict[str, Any]
DATASETS = 20
# Of every ten runs; of the other two one failed and one was cancelled.
SUCCEEDED = 8
INTERVAL = timedelta(minutes=50)


@dataclass(frozen=True)
class Filled:
    """Content of the filled database.

    Attributes:
        runs: number of runs.
        generations: number of generations of all runs.
        longest: id of the run with the most generations.
        longest_generations: number of its generations.
    """

    runs: int
    generations: int
    longest: str
    longest_generations: int


def fill(folder: Path, runs: int, generations: int, longest: int) -> Filled:
    """Copy the successful run in the database of a stopped server in ``folder`` until there are ``runs``.

    Every copy has ``generations`` generations, which repeat those of the original; the newest copy has ``longest``.
    """
    database = Database(folder)
    try:
        with database.write() as session:
            original = session.scalars(select(RunRow).where(RunRow.state == State.SUCCEEDED.value)).first()
            if original is None:
                raise RuntimeError(f"no run in {folder} has succeeded; let the server compute one first")
            past = [columns(row) for row in store.steps(session, GenerationRow, original.id)]
            copies = _copies(columns(original), _datasets(session, original.dataset_id), runs - 1)
            first, last = copies[0], copies[-1]
            for copy in copies:
                copy |= _length(past, longest if copy is last else generations)
            session.execute(insert(RunRow), copies)
            for copy in (first, last):
                session.execute(insert(GenerationRow), _generations(past, copy))
            _copy_generations(session, first["id"], [original.id, first["id"], last["id"]])
        with database.read() as session:
            return Filled(_count(session, RunRow), _count(session, GenerationRow), last["id"], longest)
    finally:
        database.close()


def _datasets(session: Session, dataset_id: str) -> list[str]:
    """Store DATASETS - 1 copies of a dataset; return the ids of the dataset and its copies."""
    row, body = store.one(session, DatasetRow, dataset_id), store.archive(session, dataset_id)
    copies = [_unnumbered(row) | {"id": store.new_id("ds"), "name": f"{row.name} {n}"} for n in range(2, DATASETS + 1)]
    session.execute(insert(DatasetRow), copies)
    session.execute(insert(ArchiveRow), [{"dataset_id": copy["id"], "body": body} for copy in copies])
    return [dataset_id, *(copy["id"] for copy in copies)]


def _copies(original: Values, datasets: list[str], number: int) -> list[Values]:
    """Return ``number`` database rows of runs like ``original``, each with its own seed.

    They ended one every 50 minutes until now, and use the ``datasets`` (ids) in turn.
    """
    until, copies = datetime.now(UTC), []
    for place in range(number):
        ended = until - (number - place) * INTERVAL
        start = store.timestamp(ended - timedelta(seconds=original["elapsed_seconds"]))
        copy = original | {
            "id": store.new_id("run"),
            "name": f"{original['name']}, seed {place}",
            "dataset_id": datasets[place % len(datasets)],
            "spec": original["spec"] | {"seed": place},
            "created_at": start,
            "started_at": start,
            "finished_at": store.timestamp(ended),
        }
        del copy["number"]
        copies.append(copy | _ending(place))
    return copies


def _ending(place: int) -> Values:
    """Return the columns of the copy number ``place`` that differ from those of a success: none for 8 of 10 copies."""
    if place % 10 < SUCCEEDED:
        return {}
    if place % 2:
        return {"state": State.CANCELLED.value, "result": None}
    return {"state": State.FAILED.value, "result": None, "error": "every individual of generation 3 diverged"}


def _unnumbered(row: DatasetRow) -> Values:
    """Return the columns of a database row without its automatic number."""
    return {name: value for name, value in columns(row).items() if name != "number"}


def _generations(past: list[Values], run: Values) -> list[Values]:
    """Return database rows of the generations of ``run``: the generations ``past`` of another run, repeated in turn."""
    return [
        past[(sequence - 1) % len(past)]
        | {
            "job_id": run["id"],
            "sequence": sequence,
            "generation": sequence - 1,
            "evaluations": after["evaluations"],
            "elapsed_seconds": after["elapsed_seconds"],
            "progress": sequence / run["generations"],
        }
        for sequence in range(1, run["generations"] + 1)
        for after in [_length(past, sequence)]
    ]


def _length(past: list[Values], generations: int) -> Values:
    """Return counters of a run after ``generations`` generations, at the pace of another run.

    ``past``: generations of that run. The counters are generations, evaluations (individuals) and elapsed seconds.
    """
    part = generations / len(past)
    return {
        "generations": generations,
        "evaluations": round(past[-1]["evaluations"] * part),
        "elapsed_seconds": past[-1]["elapsed_seconds"] * part,
    }


def _copy_generations(session: Session, model: str, have: list[str]) -> None:
    """Copy the generations of the run ``model`` (id) to all runs not in ``have``, in one SQL statement for speed."""
    names = [column.key for column in GenerationRow.__table__.columns]
    theirs = [RunRow.id if name == "run_id" else getattr(GenerationRow, name) for name in names]
    rows = select(*theirs).join(RunRow, literal(True)).where(GenerationRow.job_id == model, RunRow.id.not_in(have))
    session.execute(insert(GenerationRow).from_select(names, rows))


def _count(session: Session, table: type[RunRow] | type[GenerationRow]) -> int:
    return session.scalar(select(func.count()).select_from(table)) or 0
