"""The quick way to the commonest reads: the same answers as the shapes and the routes give, and never an old one."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import select
from sqlalchemy.orm import Session

from tests.service import toy
from tests.service.conftest import Api, toy_service
from wingfit.client.answers import HistoryItem, Run
from wingfit.service.answers import checked
from wingfit.service.auth.access import KeyRing
from wingfit.service.container import Service
from wingfit.service.examples import EXAMPLES
from wingfit.service.http import json_reads, quick
from wingfit.service.http.events import Events, Told, Watched
from wingfit.service.jobs.wakeups import Changes
from wingfit.service.runs import views
from wingfit.service.storage import store
from wingfit.service.storage.database import Database
from wingfit.service.storage.tables import GenerationRow, RunRow

Json = dict[str, Any]


class Used:
    """A server with three runs that have ended, oldest first: of two datasets, one that broke."""

    def __init__(self, service: Service, api: Api) -> None:
        self.service, self.api = service, api
        self.one, other = api.upload()["id"], api.upload(name="other")["id"]
        submitted = ((self.one, 1), (other, 2), (self.one, toy.UNLUCKY))
        self.runs = [api.submit(dataset, seed=seed)["id"] for dataset, seed in submitted]
        for run in self.runs:
            api.finish(run)

    def path(self, form: str) -> str:
        cursor = self.api.get("/v1/runs?limit=1")["next_cursor"]
        return "/v1/" + form.replace("RUN", self.runs[0]).replace("ONE", self.one).replace("CURSOR", cursor)


@pytest.fixture(scope="module")
def used(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Used]:
    with toy_service(tmp_path_factory.mktemp("used")) as (service, api):
        yield Used(service, api)


def test_answers_are_what_the_shapes_make_of_the_rows(used: Used) -> None:
    with used.service.database.read() as session:
        rows = list(session.scalars(select(RunRow).order_by(RunRow.number.desc())))
        past = store.steps(session, GenerationRow, used.runs[0])
    assert used.api.get("/v1/runs") == {"items": [views.run(row) for row in rows], "next_cursor": None}
    for row in rows:
        assert used.api.run(row.id) == views.run(row)
    items = [checked(HistoryItem, views.columns(row)) for row in past]
    assert used.api.get(f"/v1/runs/{used.runs[0]}/history") == {"items": items, "next_cursor": None}
    assert len(past) == 10


FILTERS = ("dataset_id", "state", "owner", "before")
USUAL = (
    "runs?limit=2", "runs?limit=2&cursor=CURSOR", "runs?limit=50", "runs/RUN", "runs/RUN/history",
    "runs/RUN/history?after=3&limit=4", "runs/RUN/history?after=9007199254740991",
)  # fmt: skip
UNUSUAL = (
    "runs?dataset_id=ONE", "runs?state=FAILED", "runs?dataset_id=ONE&state=FAILED", "runs?dataset_id=none",
    "runs?limit=200",
    "runs/", "runs?limit=0", "runs?limit=201", "runs?limit=-1", "runs?limit=", "runs?limit=1.0", "runs?state=NONE",
    "runs?state=", "runs?cursor=none", "runs?limit=1&limit=2", "runs?limit=1&", "runs?&limit=1", "runs?other=1",
    "runs/RUN?limit=1", "runs/none", "runs/none/history", "runs/RUN/history?after=-1", "runs/RUN/history?limit=10001",
    "runs/RUN/history?limit=5000", "runs/RUN/history?cursor=1", "runs/RUN/history?after=9007199254740992",
)  # fmt: skip


@pytest.fixture
def framed(used: Used, monkeypatch: pytest.MonkeyPatch) -> None:
    """All that is asked goes to the framework."""
    monkeypatch.setattr(used.service.shortcut, "answer", lambda *_: None)


@pytest.mark.usefixtures("framed")
@pytest.mark.parametrize("form", [*USUAL, *UNUSUAL])
def test_the_routes_answer_alike(used: Used, form: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = used.path(form)
    first = seen(used.api.client.get(path))
    routed = []

    def leave(scope: Json) -> None:
        routed.append(scope["path"])
        raise quick.UnusualError

    monkeypatch.setattr(quick, "_answer", leave)
    assert seen(used.api.client.get(path)) == first
    assert routed


@pytest.mark.usefixtures("framed")
@pytest.mark.parametrize("form", USUAL)
def test_what_is_usual_is_not_left_to_the_routes(used: Used, form: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = used.path(form)
    answered = []
    answer = quick._answer

    def noted(scope: Any) -> Any:
        answered.append(answer(scope))
        return answered[-1]

    monkeypatch.setattr(quick, "_answer", noted)
    assert used.api.client.get(path).status_code == 200
    assert len(answered) == 1


@pytest.mark.parametrize(
    ("run", "last", "status"), [("RUN", "", 200), ("RUN", "7", 200), ("RUN", "none", 422), ("none", "", 404)]
)
def test_events_are_the_same_the_quick_way(
    used: Used, run: str, last: str, status: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, headers = used.path(f"runs/{run}/events"), {"Last-Event-ID": last} if last else {}
    quickly = []
    events = quick._events

    def noted(*asked: Any) -> Any:
        quickly.append(events(*asked))
        return quickly[-1]

    monkeypatch.setattr(quick, "_events", noted)
    first = used.api.client.get(path, headers=headers)
    monkeypatch.undo()
    monkeypatch.setattr(quick, "_events", leave)
    second = used.api.client.get(path, headers=headers)
    assert (first.status_code, first.text, len(quickly)) == (status, second.text, int(status == 200))
    assert second.status_code == status
    assert dict(first.headers).keys() == dict(second.headers).keys()
    assert status != 200 or first.text.count("event: generation") == (3 if last else 10)


def leave(*_: object) -> None:
    raise quick.UnusualError


def seen(answer: httpx.Response) -> tuple[object, ...]:
    own = {"date", "x-request-id"}
    headers = {name: value for name, value in answer.headers.items() if name not in own}
    return answer.status_code, answer.json() if answer.content else None, headers


def test_what_was_written_is_read_at_once(used: Used) -> None:
    paths = [f"/v1/runs/{used.runs[1]}", "/v1/runs"]
    before = [used.api.get(path) for path in paths]
    for name in ("another", before[0]["name"]):
        with used.service.database.write() as session:
            store.one(session, RunRow, used.runs[1]).name = name
        after = used.api.get(paths[0]), used.api.get(paths[1])["items"][1]
        assert [run["name"] for run in after] == [name, name]
    assert [used.api.get(path) for path in paths] == before


def test_a_run_that_the_caller_has_is_not_sent_again(used: Used) -> None:
    path = f"/v1/runs/{used.runs[0]}"
    tag = used.api.client.get(path).headers["ETag"]
    again = used.api.client.get(path, headers={"If-None-Match": tag})
    assert (again.status_code, again.content, again.headers["ETag"]) == (304, b"", tag)
    assert used.api.client.get(path, headers={"If-None-Match": '"other"'}).status_code == 200


def test_who_watches_the_same_shares_the_look_and_sees_every_change(tmp_path: Path) -> None:
    database, changes = Database(tmp_path), Changes()
    events, looks = Events(database, changes, KeyRing()), []
    states = ["QUEUED", "RUNNING", "SUCCEEDED"]

    def look(_session: Session, after: int, _limit: int) -> Told:
        looks.append(after)
        return Told(job(states[min(database.version - first, 2)]), [])

    async def watch() -> list[bytes]:
        return [part async for part in events._stream(Watched("run_1", "generation", look), 0)]

    async def all_of_them() -> list[list[bytes]]:
        watching = [asyncio.create_task(watch()) for _ in range(20)]
        for _ in range(2):
            await asyncio.sleep(0.05)
            with database.write():
                pass
            changes.publish("run_1")
        return await asyncio.gather(*watching)

    first = database.version
    told = asyncio.run(all_of_them())
    assert [[state for state in states if state.encode() in part] for part in told[0]] == [[state] for state in states]
    assert told == [told[0]] * 20
    assert len(looks) == 3
    assert not events._looks, "nothing is kept of what was sent"
    database.close()


def test_a_look_that_fails_is_done_anew(tmp_path: Path) -> None:
    database = Database(tmp_path)
    events, looks = Events(database, Changes(), KeyRing()), []

    def look(_session: Session, after: int, _limit: int) -> Told:
        looks.append(after)
        if len(looks) == 1:
            raise OSError("the disk did not answer")
        return Told(job("SUCCEEDED"), [])

    async def watch() -> list[bytes]:
        return [part async for part in events._stream(Watched("run_1", "generation", look), 0)]

    with pytest.raises(OSError, match="did not answer"):
        asyncio.run(watch())
    assert b"SUCCEEDED" in asyncio.run(watch())[0]
    database.close()


def job(state: str) -> Run:
    return checked(Run, {**EXAMPLES[Run], "state": state})


@pytest.mark.parametrize("filters", [some for n in range(5) for some in combinations(FILTERS, n)])
def test_pages_are_found_through_an_index_and_need_no_sorting(used: Used, filters: tuple[str, ...]) -> None:
    where = tuple("number < :before" if name == "before" else f"{name} = :{name}" for name in filters)
    values = {"dataset_id": used.one, "state": "FAILED", "owner": None, "before": 9, "most": 51}
    with used.service.database.look() as look:
        plans = [
            *look.execute(f"EXPLAIN QUERY PLAN {json_reads._page_of_runs(where)}", values),
            *look.execute(f"EXPLAIN QUERY PLAN {json_reads._HISTORY}", ("run_1", 0, 51)),
        ]
    told = [str(step[3]) for step in plans]
    assert not any("TEMP B-TREE" in step for step in told), told
    # Without a filter the newest are taken from the end of the table.
    assert all(step.startswith("SEARCH") for step in told[bool(not filters) :]), told
