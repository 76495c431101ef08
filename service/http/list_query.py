"""Query parameters of lists that are filtered and sorted."""

from __future__ import annotations

from typing import Annotated

from fastapi import Query

from wingfit.client.answers import FitBadge
from wingfit.client.lists.answers import DatasetSort, DiagnosisSort, Order, RunSort

_SORT = Query(description="order; items without a value come last")
OfRuns = Annotated[RunSort, _SORT]
OfDiagnoses = Annotated[DiagnosisSort, _SORT]
OfDatasets = Annotated[DatasetSort, _SORT]
Way = Annotated[Order | None, Query(description="default: desc for created_at, else asc")]
Text = Annotated[
    str | None,
    Query(
        alias="q",
        min_length=1,
        max_length=200,
        description="part of the name or notes, or a whole id; A to Z and a to z are equal",
    ),
]
Fit = Annotated[FitBadge | None, Query(description="only those whose model fits so")]
Active = Annotated[bool, Query(description="only those that have not ended")]
OfDataset = Annotated[str | None, Query(max_length=200)]


def ascending(sort: str, order: Order | None) -> bool:
    """Return whether small values come first; ``order`` None: the newest, or the smallest, come first."""
    return sort != "created_at" if order is None else order == "asc"
