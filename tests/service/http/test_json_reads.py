"""Reads that pass by the object mapper: the same answers as the schemas give, of the caller's own rows."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import ExitStack
from itertools import combinations
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import select
from sqlalchemy.orm import Session

from tests.service import toy
from tests.service.conftest import Api, made, toy_service
from wingfit.client.answers import HistoryItem, Run
from wingfit.service.answers import checked
from wingfit.service.auth.access import KeyRing
from wingfit.service.container import Service
from wingfit.service.examples import EXAMPLES
from wingfit.service.http import json_reads
from wingfit.service.http.events import Events, JobState, Watched
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


def test_answers_are_what_the_schemas_make_of_the_rows(used: Used) -> None:
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


def test_filters_and_pages_select_what_they_name(used: Used) -> None:
    def names(query: str) -> list[str]:
        return [run["id"] for run in used.api.get(f"/v1/runs{query}")["items"]]

    oldest_first = used.runs
    assert names("") == oldest_first[::-1]
    assert names(f"?dataset_id={used.one}") == [oldest_first[2], oldest_first[0]]
    assert names("?state=FAILED") == [oldest_first[2]]
    assert names(f"?dataset_id={used.one}&state=SUCCEEDED") == [oldest_first[0]]
    assert names("?dataset_id=none") == []
    cursor = used.api.get("/v1/runs?limit=2")["next_cursor"]
    assert names(f"?limit=2&cursor={cursor}") == [oldest_first[0]]
    path = f"/v1/runs/{oldest_first[0]}/history"
    page = used.api.get(f"{path}?after=3&limit=4")
    assert ([item["sequence"] for item in page["items"]], page["next_cursor"]) == ([4, 5, 6, 7], "7")
    whole = used.api.get(path)
    assert used.api.get(f"{path}?limit=5000") == whole  # read in a thread
    assert used.api.get(f"{path}?after=9007199254740991") == {"items": [], "next_cursor": None}


@pytest.mark.parametrize(
    "form",
    [
        "runs?limit=0", "runs?limit=201", "runs?limit=-1", "runs?limit=", "runs?limit=1.5", "runs?state=NONE",
        "runs?state=", "runs?cursor=none", "runs?other=1", "runs/RUN?limit=1", "runs/RUN/history?after=-1",
        "runs/RUN/history?limit=10001", "runs/RUN/history?cursor=1", "runs/RUN/history?after=9007199254740992",
    ],
)  # fmt: skip
def test_invalid_queries_are_refused(used: Used, form: str) -> None:
    answer = used.api.client.get(f"/v1/{form.replace('RUN', used.runs[0])}")
    assert (answer.status_code, answer.json()["type"]) == (422, "urn:wingfit:problem:invalid")


@pytest.mark.parametrize("path", ["runs/none", "runs/none/history", "runs/none/events"])
def test_an_unknown_run_is_not_found(used: Used, path: str) -> None:
    assert used.api.client.get(f"/v1/{path}").status_code == 404


def test_every_read_is_of_the_callers_own_rows(tmp_path: Path) -> None:
    secrets = {name: made(tmp_path, name, *scopes) for name, scopes in KEYS.items()}
    with toy_service(tmp_path, require_keys=True) as (_, api), ExitStack() as opened:
        apis = {name: Api(opened.enter_context(with_key(api.client, secret))) for name, secret in secrets.items()}
        used = Used(_, apis["ann"])
        for _ in range(2):
            assert [len(apis[name].get("/v1/runs")["items"]) for name in KEYS] == [3, 3, 0]
            for path in ("", "/history", "/events"):
                answers = [apis[name].client.get(f"/v1/runs/{used.runs[0]}{path}").status_code for name in KEYS]
                assert answers == [200, 200, 404], path
            assert api.client.get("/v1/runs").status_code == 401
        ann = next(key for key in apis["admin"].get("/v1/keys")["items"] if key["name"] == "ann")
        assert apis["admin"].client.delete(f"/v1/keys/{ann['id']}").status_code == 200
        assert apis["ann"].client.get(f"/v1/runs/{used.runs[0]}").status_code == 401


KEYS = {"admin": ["admin"], "ann": ["read", "write"], "bob": ["read", "write"]}


def with_key(client: httpx.Client, secret: str) -> httpx.Client:
    return httpx.Client(base_url=client.base_url, headers={"Authorization": f"Bearer {secret}"}, timeout=60.0)


def test_a_write_is_visible_in_the_next_read(used: Used) -> None:
    paths = [f"/v1/runs/{used.runs[1]}", "/v1/runs"]
    before = [used.api.get(path) for path in paths]
    for name in ("another", before[0]["name"]):
        with used.service.database.write() as session:
            store.one(session, RunRow, used.runs[1]).name = name
        after = used.api.get(paths[0]), used.api.get(paths[1])["items"][1]
        assert [run["name"] for run in after] == [name, name]
    assert [used.api.get(path) for path in paths] == before


def test_an_unchanged_run_is_a_304(used: Used) -> None:
    path = f"/v1/runs/{used.runs[0]}"
    tag = used.api.client.get(path).headers["ETag"]
    again = used.api.client.get(path, headers={"If-None-Match": tag})
    assert (again.status_code, again.content, again.headers["ETag"]) == (304, b"", tag)
    assert used.api.client.get(path, headers={"If-None-Match": '"other"'}).status_code == 200


def test_streams_of_one_job_share_a_read_and_get_every_change(tmp_path: Path) -> None:
    database, changes = Database(tmp_path), Changes()
    events, looks = Events(database, changes, KeyRing()), []
    states = ["QUEUED", "RUNNING", "SUCCEEDED"]

    def look(_session: Session, after: int, _limit: int) -> JobState:
        looks.append(after)
        return job(states[min(database.version - first, 2)]), []

    sent: list[list[bytes]] = [[] for _ in range(20)]

    async def watch(own: list[bytes]) -> None:
        async for part in events._stream(Watched("run_1", "generation", look), 0):
            own.append(part)  # noqa: PERF401 - each part is seen as it comes

    async def all_of_them() -> None:
        watching = [asyncio.create_task(watch(own)) for own in sent]
        async with asyncio.timeout(60.0):
            for number in (1, 2):
                while any(len(own) < number for own in sent):
                    await asyncio.sleep(0.01)
                with database.write():
                    pass
                changes.publish("run_1")
            await asyncio.gather(*watching)

    first = database.version
    asyncio.run(all_of_them())
    assert [[state for state in states if state.encode() in part] for part in sent[0]] == [[state] for state in states]
    assert sent == [sent[0]] * 20
    assert len(looks) == 3
    assert not events._reads, "nothing is kept of what was sent"
    database.close()


def test_a_failed_read_is_repeated(tmp_path: Path) -> None:
    database = Database(tmp_path)
    events, looks = Events(database, Changes(), KeyRing()), []

    def look(_session: Session, after: int, _limit: int) -> JobState:
        looks.append(after)
        if len(looks) == 1:
            raise OSError("the disk did not answer")
        return job("SUCCEEDED"), []

    async def watch() -> list[bytes]:
        return [part async for part in events._stream(Watched("run_1", "generation", look), 0)]

    with pytest.raises(OSError, match="did not answer"):
        asyncio.run(watch())
    assert b"SUCCEEDED" in asyncio.run(watch())[0]
    database.close()


def job(state: str) -> Run:
    return checked(Run, {**EXAMPLES[Run], "state": state})


@pytest.mark.parametrize("filters", [some for n in range(5) for some in combinations(FILTERS, n)])
def test_pages_use_an_index_and_need_no_sorting(used: Used, filters: tuple[str, ...]) -> None:
    where = tuple("number < :before" if name == "before" else f"{name} = :{name}" for name in filters)
    values = {"dataset_id": used.one, "state": "FAILED", "owner": None, "before": 9, "rows": 51}
    with used.service.database.look() as look:
        plans = [
            *look.execute(f"EXPLAIN QUERY PLAN {json_reads._page_of_runs(where)}", values),
            *look.execute(f"EXPLAIN QUERY PLAN {json_reads._HISTORY}", ("run_1", 0, 51)),
        ]
    told = [str(step[3]) for step in plans]
    assert not any("TEMP B-TREE" in step for step in told), told
    # Without a filter the newest are taken from the end of the table.
    assert all(step.startswith("SEARCH") for step in told[bool(not filters) :]), told
