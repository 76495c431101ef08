"""Lists that are filtered, sorted and paged, and changes of names and notes."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from sqlalchemy import insert

from tests.service.conftest import Api, As, toy_service
from wingfit.client.client import Client, WingfitError
from wingfit.client.lists.answers import DatasetSort, DiagnosisSort, RunSort
from wingfit.service.container import Service
from wingfit.service.runs.requests import LONGEST_NOTES
from wingfit.service.runs.views import columns
from wingfit.service.settings import Settings
from wingfit.service.storage import store
from wingfit.service.storage.listing import SORTS
from wingfit.service.storage.tables import DatasetRow, DiagnosisRow, RunRow

COUNT = 12
KEYS = {"runs": RunRow, "diagnoses": DiagnosisRow, "datasets": DatasetRow}
SORTED = [(path, sort) for path, table in KEYS.items() for sort in SORTS[table]]


class Filled:
    """A server with twelve runs and diagnoses of three datasets that differ in everything that lists sort by."""

    def __init__(self, service: Service, api: Api) -> None:
        self.api = api
        first = api.upload(name="b wing")["id"]
        self.datasets = [first, api.upload(name="A wing")["id"], api.upload(name="c wing", held_out=[])["id"]]
        run, diagnosis = api.submit(first)["id"], api.diagnose(first)["id"]
        api.finish(run)
        api.diagnosed(diagnosis)
        with service.database.write() as session:
            for table, made, prefix in ((RunRow, run, "run"), (DiagnosisRow, diagnosis, "dx")):
                row = store.one(session, table, made)
                assert isinstance(row, RunRow | DiagnosisRow)
                session.execute(insert(table), [self._copy(columns(row), prefix, k) for k in range(1, COUNT)])
                row.residual_over_noise = row.held_out_over_noise = None

    def _copy(self, values: dict[str, Any], prefix: str, k: int) -> dict[str, Any]:
        spec = dict(values["spec"])
        inner = spec if prefix == "run" else spec["calibration"]
        inner |= {"division": ("4", "11", "24")[k % 3], "method": ("genetic", "auto")[k % 2]}
        changed = {
            "id": f"{prefix}_{k}",
            "name": f"{'xY'[k % 2]} {k % 5}",
            "notes": "50% of\nthe ROD_1" if k == 7 else "",
            "dataset_id": self.datasets[k % 3],
            "state": ("SUCCEEDED", "FAILED", "CANCELLED")[k % 3],
            "spec": spec,
            "generations": k // 2,
            "residual_over_noise": None if k % 4 == 0 else 0.5 + k / 4,
            "held_out_over_noise": None if k % 3 == 0 else 5.0 - k / 4,
        }
        if prefix == "run":
            changed |= {"best_mm": None if k % 5 == 0 else 9.0 - k}
        else:
            changed |= {"verdict": ("named", None, "adequate")[k % 3], "run_id": None}
        return {name: value for name, value in values.items() if name != "number"} | changed

    def pages(self, query: str, limit: int = 5) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = []
        joint, cursor = "&" if "?" in query else "?", ""
        while True:
            page = self.api.get(f"/v1/{query}{joint}limit={limit}{cursor}")
            found += page["items"]
            if page["next_cursor"] is None:
                return found
            assert len(page["items"]) == limit
            cursor = f"&cursor={page['next_cursor']}"


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Filled]:
    with toy_service(tmp_path_factory.mktemp("filled")) as (service, api):
        yield Filled(service, api)


def test_the_orders_of_the_client_are_those_of_the_server() -> None:
    for table, sorts in ((RunRow, RunSort), (DiagnosisRow, DiagnosisSort), (DatasetRow, DatasetSort)):
        assert set(get_args(sorts)) == set(SORTS[table])


@pytest.mark.parametrize(("path", "sort"), SORTED)
@pytest.mark.parametrize("order", ["asc", "desc"])
def test_pages_of_every_order_are_the_whole_list_in_that_order(
    filled: Filled, path: str, sort: str, order: str
) -> None:
    query = f"{path}?sort={sort}&order={order}"
    whole = filled.pages(query, limit=200)
    assert [one["id"] for one in filled.pages(query, limit=5 if path != "datasets" else 1)] == [
        one["id"] for one in whole
    ]
    assert len(whole) == (3 if path == "datasets" else COUNT)
    values = [_value(filled, path, sort, one) for one in whole]
    known = [value for value in values if value is not None]
    assert known == sorted(known, reverse=order == "desc")
    assert values == known + [None] * (len(values) - len(known)), "those without a value come last"


def _value(filled: Filled, path: str, sort: str, one: dict[str, Any]) -> Any:
    """What a list sorted by ``sort`` is sorted by."""
    names = dict(zip(filled.datasets, ("b wing", "a wing", "c wing"), strict=True))
    states = ("RUNNING", "QUEUED", "PAUSED", "SUCCEEDED", "FAILED", "CANCELLED")
    of: dict[str, Any] = {
        "name": lambda: one["name"].lower(),
        "dataset": lambda: names[one["dataset_id"]],
        "state": lambda: states.index(one["state"]),
        "misfit": lambda: one["best_mm"],
        "model": lambda: int(one["spec"]["division"]),
        "method": lambda: one["spec"]["method"],
        "recordings": lambda: len(one["recordings"]),
        "held_out": lambda: sum(recording["held_out"] for recording in one["recordings"]),
    }
    fits = {f"{'run' if path == 'runs' else 'dx'}_{k}": k for k in range(1, COUNT)}
    if sort in ("residual_over_noise", "held_out_over_noise", "fit"):
        k = fits.get(one["id"])
        fitted = None if k is None or k % 4 == 0 else 0.5 + k / 4
        held = None if k is None or k % 3 == 0 else 5.0 - k / 4
        worst = None if fitted is None else max(fitted, fitted if held is None else held)
        return {"residual_over_noise": fitted, "held_out_over_noise": held, "fit": worst}[sort]
    return of.get(sort, lambda: one[sort])()


@pytest.mark.parametrize("path", ["runs", "diagnoses"])
def test_filters_select_what_they_name(filled: Filled, path: str) -> None:
    def ids(query: str) -> set[int]:
        found = {one["id"].partition("_")[2] for one in filled.pages(f"{path}?{query}", limit=200)}
        return {int(one) for one in found if len(one) < 3}

    others = set(range(1, COUNT))
    assert ids("q=y") == {k for k in others if k % 2}
    assert ids("q=rod_") == ids("q=50%25 of") == {7}
    assert ids("q=%25") == {7}, "no pattern: what stands there"
    assert ids(f"q={'run' if path == 'runs' else 'dx'}_3") == {3}
    assert ids("q=nothing") == set()
    assert ids("active=true") == set()
    assert ids(f"state=FAILED&q=y&dataset_id={filled.datasets[1]}") == {1, 7}
    worst = {k: max(0.5 + k / 4, 0.5 + k / 4 if k % 3 == 0 else 5 - k / 4) for k in others if k % 4}
    assert ids("badge=good") == {k for k in worst if worst[k] <= 1.3}
    assert ids("badge=doubtful") == {k for k in worst if 1.3 < worst[k] <= 3.0}
    assert ids("badge=wrong") == {k for k in worst if worst[k] > 3.0}
    assert ids("badge=wrong")
    assert ids("badge=doubtful")


def test_groups_count_what_a_list_contains(filled: Filled) -> None:
    for query in ("", "q=y", "state=FAILED", "badge=wrong"):
        listed = [run["dataset_id"] for run in filled.pages(f"runs?{query}", limit=200)]
        groups = filled.pages(f"runs/groups?{query}", limit=2)
        assert {group["dataset_id"]: group["count"] for group in groups} == {
            one: listed.count(one) for one in dict.fromkeys(listed)
        }
        assert [group["dataset_id"] for group in groups] == list(dict.fromkeys(listed)), "the newest run first"
    assert {group["dataset_name"] for group in filled.pages("diagnoses/groups")} == {"b wing", "A wing", "c wing"}


def _cursor(body: str) -> str:
    return "next-" + base64.urlsafe_b64encode(body.encode()).decode().rstrip("=")


@pytest.mark.parametrize(
    "query",
    [
        "sort=nothing", "order=up", "badge=bad", "q=", "active=perhaps", "cursor=next-", "cursor=next-e30",
        "sort=name&cursor=before-3", "sort=name&cursor=" + _cursor('["misfit",true,1,1]'),
        "sort=name&cursor=" + _cursor('["name",true,99999999999999999999,1]'),
        "sort=name&cursor=" + _cursor('["name",true,{},1]'),
    ],
)  # fmt: skip
def test_unknown_values_are_refused(filled: Filled, query: str) -> None:
    for path in ("runs", "diagnoses"):
        answer = filled.api.client.get(f"/v1/{path}?{query}")
        assert (answer.status_code, answer.json()["type"]) == (422, "urn:wingfit:problem:invalid"), path


def test_names_and_notes_are_changed_and_found(api: Api) -> None:
    dataset = api.upload()["id"]
    run, diagnosis = api.submit(dataset)["id"], api.diagnose(dataset)["id"]
    api.finish(run)
    api.diagnosed(diagnosis)
    with Client(str(api.client.base_url)) as client:
        edits = (
            (client.update_run, client.run, run),
            (client.update_diagnosis, client.diagnosis, diagnosis),
            (client.update_dataset, client.dataset, dataset),
        )
        for update, fetch, identity in edits:
            before = fetch(identity)
            assert before["notes"] == ""
            assert update(identity, notes="two\nlines") == {**before, "notes": "two\nlines"}
            assert update(identity, name="Zitterwand") == {**before, "notes": "two\nlines", "name": "Zitterwand"}
            assert update(identity, notes="") == fetch(identity) == {**before, "name": "Zitterwand"}
        assert [one["id"] for one in client.runs(q="zitter")] == [run]
        assert [one["id"] for one in client.diagnoses(q="zitter", sort="name", order="desc")] == [diagnosis]
        assert [one["id"] for one in client.datasets(q="zitter", kind="tracks")] == [dataset]
        assert client.run_groups(q="zitter") == [{"dataset_id": dataset, "dataset_name": "Zitterwand", "count": 1}]
        assert client.diagnosis_groups(state="FAILED") == []
        with pytest.raises(WingfitError, match="there is no run"):
            client.update_run("run_0", notes="x")


@pytest.mark.parametrize(
    "body",
    [{}, {"name": None, "notes": None}, {"name": ""}, {"name": "two\nlines"}, {"name": "x" * 201},
     {"notes": "\x1b[31m"}, {"notes": "turned \u202earound"},
        {"notes": "x" * (LONGEST_NOTES + 1)}, {"notes": 3}, {"state": "SUCCEEDED"}],
)  # fmt: skip
def test_names_and_notes_have_the_limits_of_a_submission(filled: Filled, body: dict[str, Any]) -> None:
    for path in (f"datasets/{filled.datasets[0]}", "runs/run_1", "diagnoses/dx_1"):
        answer = filled.api.client.patch(f"/v1/{path}", json=body)
        assert (answer.status_code, answer.json()["type"]) == (422, "urn:wingfit:problem:invalid"), path


def test_default_names_differ(api: Api) -> None:
    dataset, other = api.upload()["id"], api.upload()["id"]
    names = [api.submit(dataset)["name"] for _ in range(9)]
    assert names == ["toy, division 11, staged", *(f"toy, division 11, staged, {n}" for n in range(2, 10))]
    assert api.submit(other)["name"] == names[0], "runs of another dataset do not count"
    assert [api.submit(dataset, name="mine")["name"] for _ in range(2)] == ["mine", "mine"]
    assert [api.diagnose(dataset)["name"] for _ in range(3)] == [
        "toy, division 11", "toy, division 11, 2", "toy, division 11, 3",
    ]  # fmt: skip
    long = api.upload(name="x" * 200)["id"]
    made = [api.submit(long)["name"] for _ in range(3)]
    assert [name[189:] for name in made] == ["x" * 11, "x, 2", "x, 3"]


class TestOwners:
    @pytest.fixture
    def settings(self, tmp_path: Path) -> Settings:
        return Settings(data=tmp_path / "data", require_keys=True)

    def test_lists_and_changes_are_of_the_callers_own_rows(self, as_: As) -> None:
        ann, bob = as_("ann"), as_("bob")
        dataset = ann.upload()["id"]
        run, diagnosis = ann.submit(dataset)["id"], ann.diagnose(dataset)["id"]
        for path in (f"datasets/{dataset}", f"runs/{run}", f"diagnoses/{diagnosis}"):
            assert bob.client.patch(f"/v1/{path}", json={"name": "bob's"}).status_code == 404
            assert as_("ann-reads").client.patch(f"/v1/{path}", json={"name": "read"}).status_code == 403
            assert ann.client.patch(f"/v1/{path}", json={"name": "ann's"}).json()["name"] == "ann's"
        for path in (
            "runs?sort=name",
            "runs?q=ann",
            "runs/groups",
            "diagnoses?sort=dataset",
            "diagnoses/groups",
            "datasets?q=ann",
        ):
            assert len(ann.get(f"/v1/{path}")["items"]) == 1, path
            assert bob.get(f"/v1/{path}")["items"] == [], path
        ann.finish(run)
