"""Routes that datasets, runs and diagnoses share: change the name or the notes; count the jobs of each dataset."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Self

from fastapi import APIRouter, Path
from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from wingfit.client.answers import Page
from wingfit.client.lists.answers import JobGroup
from wingfit.service.container import ServiceDep
from wingfit.service.http import list_query as q
from wingfit.service.http import responses as http
from wingfit.service.runs.requests import Notes, Title
from wingfit.service.storage import listing, store
from wingfit.service.storage.tables import DatasetJobRow, DatasetRow, DiagnosisRow, RunRow
from wingfit.workers import jobs


class EditIn(BaseModel):
    """Body of a request that changes the name or the notes of a dataset, run or diagnosis."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"name": "stiffer rod", "notes": "after the repair of 3 May"}]}
    )

    name: Annotated[Title | None, Field(description="null: it stays")] = None
    notes: Annotated[Notes | None, Field(description="null: they stay; empty: none")] = None

    @model_validator(mode="after")
    def _changes_something(self) -> Self:
        if self.name is None and self.notes is None:
            raise PydanticCustomError("nothing", "must contain a name or notes")
        return self


def add_edit_route(
    router: APIRouter,
    what: str,
    table: type[DatasetRow] | type[RunRow] | type[DiagnosisRow],
    answer: type,
    view: Callable[[Any], Any],
) -> None:
    """Add the route that changes the name or the notes of a resource.

    ``what``: its name, e.g. "run"; ``table``: of its rows; ``answer``: type of its JSON answer, which ``view`` returns.
    """

    @router.patch(
        f"/{{{what}_id}}",
        name=f"edit_{what}",
        response_model=answer,
        responses=http.errors(404),
        summary=f"Edit a {what}",
        description=f"Change the name or the notes of a {what}; fields that the request does not contain stay.",
    )
    def edit(service: ServiceDep, body: EditIn, row_id: str = Path(alias=f"{what}_id")) -> Any:
        with service.database.write() as session:
            row = store.one(session, table, row_id)
            row.name = row.name if body.name is None else body.name
            row.notes = row.notes if body.notes is None else body.notes
            session.flush()
            return view(row)


def add_groups_route(router: APIRouter, plural: str, table: type[DatasetJobRow]) -> None:
    """Add the route that counts the jobs of each dataset; ``plural``: of their name, e.g. "runs"."""

    @router.get(
        "/groups",
        name=f"group_{plural}",
        response_model=Page[JobGroup],
        responses=http.errors(),
        summary=f"Count {plural} by dataset",
        description=f"Return the datasets of the {plural} that a list contains, and how many; the newest job first.",
    )
    def groups(
        service: ServiceDep,
        dataset_id: q.OfDataset = None,
        state: jobs.State | None = None,
        active: q.Active = False,
        badge: q.Fit = None,
        text: q.Text = None,
        limit: http.Limit = http.LARGEST_PAGE,
        cursor: http.Cursor = None,
    ) -> Page[JobGroup]:
        wanted = listing.Wanted(table, {"dataset_id": dataset_id, "state": state}, text, active, badge)
        with service.database.read() as session:
            found, following = listing.groups(session, wanted, limit, cursor)
        return {"items": found, "next_cursor": following}
