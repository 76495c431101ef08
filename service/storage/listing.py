"""Lists of datasets, films and jobs: which rows, in which order, page by page.

Conditions and orders are SQL, because lists of runs are read without the object mapper (`service/http/json_reads.py`).
Column names and expressions are constants of this module; values are bound.
"""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from sqlalchemy import ColumnElement, literal_column, select, text
from sqlalchemy.orm import Session

from wingfit.calibration.result import ADEQUATE
from wingfit.client.lists.answers import JobGroup
from wingfit.service.http.problems import ProblemError, error_item, invalid
from wingfit.service.outcomes.fit_quality import DOUBTFUL
from wingfit.service.storage.tables import DatasetJobRow, DatasetRow, DiagnosisRow, KeyRow, OwnedRow, RunRow
from wingfit.workers.jobs import State

Row = TypeVar("Row", bound=OwnedRow | KeyRow)
Values = dict[str, Any]
BEFORE, NEXT = "before-", "next-"  # beginnings of cursors
NEWEST = "created_at"
BIGGEST = 2**62  # whole number in a cursor
ACTIVE = tuple(state.value for state in State if not state.final)

_STATES = (
    "CASE state WHEN 'RUNNING' THEN 0 WHEN 'QUEUED' THEN 1 WHEN 'PAUSED' THEN 2 WHEN 'SUCCEEDED' THEN 3 "
    "WHEN 'FAILED' THEN 4 ELSE 5 END"
)
_DATASET = "(SELECT subject.name FROM dataset AS subject WHERE subject.id = dataset_id)"
_WORST = "max(residual_over_noise, coalesce(held_out_over_noise, residual_over_noise))"


def _model(spec: str) -> str:
    """Return the SQL of the model of a job; leading spaces put the numbers of bodies into the order of numbers."""
    bodies = f"printf('%12s', json_extract(spec, '{spec}.division'))"
    return f"coalesce(rig_name, CASE kind WHEN 'forces' THEN json_extract(spec, '{spec}.preset') ELSE {bodies} END)"


_OF_ALL = {NEWEST: "number", "name": "name COLLATE NOCASE"}
_OF_JOBS = _OF_ALL | {
    "dataset": f"{_DATASET} COLLATE NOCASE",
    "state": _STATES,
    "residual_over_noise": "residual_over_noise",
    "held_out_over_noise": "held_out_over_noise",
    "fit": _WORST,
}
SORTS: Mapping[type[Any], Mapping[str, str]] = {
    RunRow: {
        **_OF_JOBS,
        "misfit": "coalesce(best_mm, best_mn, best_percent)",
        "model": _model("$"),
        "method": "json_extract(spec, '$.method')",
        "generations": "generations",
    },
    DiagnosisRow: {**_OF_JOBS, "verdict": "verdict", "model": _model("$.calibration")},
    DatasetRow: {
        **_OF_ALL,
        "kind": "kind",
        "recordings": "json_array_length(recordings)",
        "held_out": "(SELECT count(*) FROM json_each(recordings) WHERE json_extract(value, '$.held_out'))",
        "size_bytes": "size_bytes",
    },
}
_BADGES = {
    "good": f"{_WORST} <= {ADEQUATE}",
    "doubtful": f"{_WORST} > {ADEQUATE} AND {_WORST} <= {DOUBTFUL}",
    "wrong": f"{_WORST} > {DOUBTFUL}",
}


@dataclass(frozen=True)
class Wanted(Generic[Row]):
    """The rows of a list and their order.

    Attributes:
        table: whose rows are listed.
        equal: value that a column must have, by column name; columns with the value None are not compared.
        text: part of the name or of the notes, or the whole id; upper and lower case of ASCII letters are equal.
        active: only jobs that have not ended.
        badge: only jobs whose model fits so: good, doubtful or wrong.
        sort: order, a key of SORTS; rows without a value come last.
        ascending: whether small values come first.
    """

    table: type[Row]
    equal: Mapping[str, str | None] = field(default_factory=dict)
    text: str | None = None
    active: bool = False
    badge: str | None = None
    sort: str = NEWEST
    ascending: bool = False

    def __post_init__(self) -> None:
        if self.sort != NEWEST and self.sort not in SORTS[self.table]:
            known = ", ".join(sorted(SORTS[self.table]))
            item = error_item("query.sort", self.sort, f"there is no such order; use one of {known}")
            raise invalid("the list cannot be sorted so", [item])

    @property
    def plain(self) -> bool:
        """Whether the list is that of all rows, newest first."""
        filtered = self.text or self.active or self.badge or any(value is not None for value in self.equal.values())
        return not filtered and self.sort == NEWEST and not self.ascending

    @property
    def expression(self) -> str:
        """SQL by which the list is sorted."""
        return SORTS[self.table][self.sort] if self.sort != NEWEST else "number"

    @property
    def order(self) -> str:
        """SQL after ORDER BY."""
        way = "ASC" if self.ascending else "DESC"
        by_number = f"number {way}"
        return by_number if self.sort == NEWEST else f"{self.expression} {way} NULLS LAST, {by_number}"

    def conditions(self) -> tuple[tuple[str, ...], Values]:
        """Return the SQL of the conditions that a row must meet, and the values in it."""
        values: Values = {name: value for name, value in self.equal.items() if value is not None}
        where = [f"{name} = :{name}" for name in values]
        if self.active:
            where.append(f"state IN ({', '.join(repr(state) for state in ACTIVE)})")
        if self.badge is not None:
            where.append(_BADGES[self.badge])
        if self.text is not None:
            where.append("(name LIKE :part ESCAPE '!' OR notes LIKE :part ESCAPE '!' OR id = :text)")
            literally = re.sub("([!%_])", r"!\1", self.text)
            values |= {"text": self.text, "part": f"%{literally}%"}
        return tuple(where), values

    def after(self, cursor: str | None) -> tuple[tuple[str, ...], Values]:
        """Return the SQL of the condition that a row comes after ``cursor``; a 422 for a cursor of another list."""
        if cursor is None:
            return (), {}
        beyond = ">" if self.ascending else "<"
        if self.sort == NEWEST and not self.ascending:
            return (f"number {beyond} :before",), {"before": number(cursor)}
        value, last = self._place(cursor)
        values = {"before": last} if value is None else {"before": last, "value": value}
        if self.sort == NEWEST:
            return (f"number {beyond} :before",), {"before": last}
        if value is None:
            return (f"{self.expression} IS NULL AND number {beyond} :before",), values
        place = f"{self.expression} = :value AND number {beyond} :before"
        return (f"({self.expression} {beyond} :value OR {place} OR {self.expression} IS NULL)",), values

    def cursor(self, value: object, last: int) -> str:
        """Return the cursor after the row of number ``last``, which has this ``value`` of the order."""
        if self.sort == NEWEST and not self.ascending:
            return cursor_before(last)
        text = json.dumps([self.sort, self.ascending, value, last], ensure_ascii=False, separators=(",", ":"))
        return NEXT + base64.urlsafe_b64encode(text.encode("utf-8", "surrogatepass")).decode().rstrip("=")

    def _place(self, cursor: str) -> tuple[str | float | None, int]:
        """Return the value and number of the row after which ``cursor`` continues."""
        try:
            body = cursor.removeprefix(NEXT)
            text = base64.b64decode(body + "=" * (-len(body) % 4), b"-_", validate=True)
            sort, ascending, value, last = json.loads(text.decode("utf-8", "surrogatepass"))
            known = cursor.startswith(NEXT) and (sort, ascending) == (self.sort, self.ascending)
            usual = isinstance(value, str | float | None) or (isinstance(value, int) and abs(value) < BIGGEST)
            if known and usual and isinstance(last, int) and abs(last) < BIGGEST:
                return value, last
        except (ValueError, TypeError, RecursionError):
            pass
        raise _foreign(cursor)


def page(session: Session, wanted: Wanted[Row], limit: int, cursor: str | None) -> tuple[list[Row], str | None]:
    """Return up to ``limit`` rows of the list, and the cursor of the next page (None: no more).

    ``cursor``: where the page begins, as returned with the page before; None: at the first row.
    """
    where, values = wanted.conditions()
    beyond, place = wanted.after(cursor)
    sorted_by: ColumnElement[Any] = literal_column(wanted.expression)
    query = select(wanted.table, sorted_by).order_by(text(wanted.order)).limit(limit + 1)
    for condition in (*where, *beyond):
        query = query.where(text(condition))
    rows = session.execute(query, values | place).all()
    following = wanted.cursor(rows[limit - 1][1], rows[limit - 1][0].number) if len(rows) > limit else None
    return [row for row, _ in rows[:limit]], following


def groups(session: Session, wanted: Wanted[Any], limit: int, cursor: str | None) -> tuple[list[JobGroup], str | None]:
    """Return the datasets of the jobs that ``wanted`` selects, and the number of its jobs; newest job first.

    ``limit``, ``cursor``: as in :func:`page`.
    """
    table: type[DatasetJobRow] = wanted.table
    where, values = wanted.conditions()
    newest: ColumnElement[int] = literal_column("max(number)")
    name: ColumnElement[str] = literal_column(_DATASET)
    count: ColumnElement[int] = literal_column("count(*)")
    query = select(table.dataset_id, name, count, newest)
    query = query.group_by(table.dataset_id).order_by(newest.desc()).limit(limit + 1)
    for condition in where:
        query = query.where(text(condition))
    if cursor is not None:
        query, values = query.having(text("max(number) < :before")), values | {"before": number(cursor)}
    rows = session.execute(query, values).all()
    found: list[JobGroup] = [
        {"dataset_id": dataset_id, "dataset_name": named, "count": jobs} for dataset_id, named, jobs, _ in rows[:limit]
    ]
    return found, cursor_before(rows[limit - 1][3]) if len(rows) > limit else None


def cursor_before(number: int) -> str:
    """Return the page cursor (text that clients pass back unchanged) for the rows created before row ``number``."""
    return f"{BEFORE}{number}"


def number(cursor: str) -> int:
    """Return the row number in ``cursor``, text made by :func:`cursor_before`; raise a 422 for any other text."""
    if re.fullmatch(rf"{BEFORE}[0-9]{{1,18}}", cursor):
        return int(cursor.removeprefix(BEFORE))
    raise _foreign(cursor)


def _foreign(cursor: str) -> ProblemError:
    item = error_item("query.cursor", cursor, "use next_cursor of the last page, with the same filters and order")
    return invalid("the cursor is not one of this server", [item])
