"""API keys: which calls they permit, and whose data they show."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path

import httpx
import pytest
from typer.testing import CliRunner

from tests.service import toy
from tests.service.conftest import Api, As, Gate, Json, made, metrics, serving
from wingfit.cli.main import app as commands
from wingfit.client.client import Client, WingfitError
from wingfit.service.app import create_app
from wingfit.service.server import ServeError, serve
from wingfit.service.settings import Settings, SettingsError
from wingfit.service.storage.database import FILE_NAME, Database


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(data=tmp_path / "data", require_keys=True, max_active=3, max_runs_per_owner=1)


def bearer(secret: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {secret}"}


@pytest.mark.parametrize(
    "headers",
    [
        {},
        bearer("wingfit_" + "A" * 43),
        {"Authorization": "Basic YWRtaW46YWRtaW4="},
        {"Authorization": "Bearer"},
        {"Cookie": "wingfit_key=x; wingfit_key=y"},
        {"Cookie": "=;=; ,"},
    ],
)
def test_without_a_valid_key_every_call_is_refused(client: httpx.Client, headers: dict[str, str]) -> None:
    for method, path in (
        ("GET", "runs"),
        ("POST", "runs"),
        ("GET", "schemas/dataset"),
        ("GET", "nothing"),
        ("GET", "keys"),
    ):
        answer = client.request(method, f"/v1/{path}", headers=headers)
        assert (answer.status_code, answer.headers["WWW-Authenticate"]) == (401, "Bearer"), path
        assert answer.json()["type"] == "urn:wingfit:problem:key"
        assert "wingfit keys create" in answer.json()["detail"]
        assert answer.headers["X-Content-Type-Options"] == "nosniff"


def test_a_changed_key_is_invalid(client: httpx.Client, secrets: dict[str, str]) -> None:
    secret = secrets["ann"]
    assert client.get("/v1/runs", headers=bearer(secret)).status_code == 200
    for other in (secret.lower(), secret.upper(), secret.swapcase(), secret[:-1], secret + "A"):
        assert client.get("/v1/runs", headers=bearer(other)).status_code == 401, other


def test_page_health_and_session_need_no_key(client: httpx.Client) -> None:
    for path in ("/", "/app.js", "/v1/health", "/docs", "/openapi.json"):
        assert client.get(path).status_code == 200, path
    assert client.get("/v1/session").json() == {"keys_required": True, "key_id": None, "owner": None, "scopes": []}


def test_every_path_of_the_api_requires_a_key(client: httpx.Client) -> None:
    """By the published description, so that a path that is added later is asked for as well."""
    asked = 0
    for path, methods in client.get("/openapi.json").json()["paths"].items():
        for method in methods:
            status = client.request(method, path.replace("{", "").replace("}", "")).status_code
            assert (status == 401) != (path in ("/v1/health", "/v1/ready", "/v1/session")), (method, path, status)
            asked += status == 401
    assert asked > 30


def test_metrics_need_a_key_under_every_host_name(client: httpx.Client, secrets: dict[str, str]) -> None:
    by_address = {"Host": "10.0.0.7"}
    assert client.get("/v1/metrics", headers=by_address).status_code == 401
    assert metrics(client, **by_address, **bearer(secrets["ann-reads"])).status_code == 200
    assert client.get("/v1/runs", headers=by_address | bearer(secrets["ann-reads"])).status_code == 400
    assert client.get("/v1/health", headers=by_address).status_code == 200


def test_a_key_permits_only_its_scopes(as_: As) -> None:
    dataset = as_("ann").upload()["id"]
    reader, writer = as_("ann-reads").client, as_("ann").client
    assert reader.get(f"/v1/datasets/{dataset}").status_code == 200
    refused = reader.post("/v1/runs", json={"dataset_id": dataset})
    assert (refused.status_code, refused.json()["type"]) == (403, "urn:wingfit:problem:scope")
    assert "has the scope read; this call needs write" in refused.json()["detail"]
    assert reader.delete(f"/v1/datasets/{dataset}").status_code == 403
    assert writer.get("/v1/keys").status_code == 403
    assert writer.post("/v1/keys", json={"name": "x", "scopes": ["admin"]}).status_code == 403


def test_nobody_sees_data_of_other_owners(as_: As) -> None:
    ann, bob, admin = as_("ann"), as_("bob"), as_("admin")
    dataset = ann.upload()["id"]
    run = ann.submit(dataset)["id"]
    ann.finish(run)
    diagnosis = ann.diagnose(dataset)["id"]
    ann.diagnosed(diagnosis)
    for kind in ("datasets", "runs", "diagnoses"):
        assert bob.get(f"/v1/{kind}")["items"] == []
        assert len(ann.get(f"/v1/{kind}")["items"]) == len(admin.get(f"/v1/{kind}")["items"]) == 1
        assert len(as_("ann-reads").get(f"/v1/{kind}")["items"]) == 1
    exports = [f"/export?format={form}" for form in ("json", "csv", "netcdf")]
    for path in (
        f"datasets/{dataset}",
        f"datasets/{dataset}/archive",
        *(f"runs/{run}{rest}" for rest in ("", "/history", "/genome", "/result", "/comparison", "/events", *exports)),
        *(f"diagnoses/{diagnosis}{rest}" for rest in ("", "/finding", "/report", "/events", *exports)),
    ):
        assert bob.client.get(f"/v1/{path}").status_code == 404, path
        assert ann.client.get(f"/v1/{path}").status_code == 200, path
    for path in (f"runs/{run}", f"diagnoses/{diagnosis}"):
        assert bob.client.get(f"/v1/{path}/model").status_code == 404, path
    for method, path in (
        ("DELETE", f"datasets/{dataset}"),
        ("DELETE", f"runs/{run}"),
        ("POST", f"runs/{run}/cancel"),
        ("POST", f"diagnoses/{diagnosis}/cancel"),
        ("DELETE", f"diagnoses/{diagnosis}"),
    ):
        assert bob.client.request(method, f"/v1/{path}").status_code == 404, path
    for path, body in (("runs", {"dataset_id": dataset}), ("diagnoses", {"run_id": run})):
        assert bob.client.post(f"/v1/{path}", json=body).status_code == 422, path


def test_health_counts_the_jobs_of_all_owners(as_: As, gate: Gate) -> None:
    ann, bob = as_("ann"), as_("bob")
    run = ann.submit(ann.upload()["id"])["id"]
    ann.until(run, lambda now: now["state"] == "RUNNING")
    assert bob.get("/v1/health")["runs_active"] == 1
    assert 'wingfit_jobs{kind="run",state="RUNNING"} 1.0' in metrics(bob.client).text
    gate.let(100)
    ann.finish(run)


def test_a_job_has_the_owner_of_its_dataset(as_: As) -> None:
    ann, admin = as_("ann"), as_("admin")
    dataset = ann.upload()["id"]
    run = admin.submit(dataset)["id"]
    assert ann.finish(run)["state"] == "SUCCEEDED"
    assert ann.client.delete(f"/v1/datasets/{dataset}").status_code == 409
    assert ann.client.delete(f"/v1/runs/{run}").status_code == 204
    assert ann.client.delete(f"/v1/datasets/{dataset}").status_code == 204


def test_repeated_requests_of_different_owners_are_different_ones(as_: As) -> None:
    headers, files = {"Idempotency-Key": "once"}, {"file": ("toy.zip", toy.archive())}
    ids = [as_(name).client.post("/v1/datasets", files=files, headers=headers).json()["id"] for name in ("ann", "bob")]
    assert ids[0] != ids[1]
    assert as_("ann").client.post("/v1/datasets", files=files, headers=headers).json()["id"] == ids[0]


def test_an_owner_has_limited_jobs(as_: As, gate: Gate) -> None:
    ann, bob = as_("ann"), as_("bob")
    of_ann = [ann.submit(ann.upload()["id"])["id"] for _ in range(3)]
    refused = ann.client.post("/v1/runs", json={"dataset_id": ann.get(f"/v1/runs/{of_ann[0]}")["dataset_id"]})
    assert (refused.status_code, refused.json()["type"]) == (429, "urn:wingfit:problem:too-many")
    of_bob = bob.submit(bob.upload()["id"])["id"]
    bob.until(of_bob, lambda run: run["state"] == "RUNNING")  # though two of ann's wait, and were there before
    assert [ann.run(run)["state"] for run in of_ann] == ["RUNNING", "QUEUED", "QUEUED"]
    gate.let(100)
    for run in of_ann:
        assert ann.finish(run)["state"] == "SUCCEEDED"


def test_keys_are_made_shown_once_and_revoked_at_once(as_: As, client: httpx.Client, settings: Settings) -> None:
    admin = as_("admin").client
    new = admin.post("/v1/keys", json={"name": "bench", "owner": "ann"}).json()
    assert (new["owner"], new["scopes"], new["revoked_at"]) == ("ann", ["read", "write"], None)
    assert client.get("/v1/runs", headers=bearer(new["secret"])).status_code == 200
    assert new["secret"] not in admin.get("/v1/keys").text
    with sqlite3.connect(settings.data / FILE_NAME) as connection:
        assert new["secret"] not in json.dumps(connection.execute("select * from key").fetchall())
    connection.close()
    assert admin.delete(f"/v1/keys/{new['id']}").json()["revoked_at"]
    assert client.get("/v1/runs", headers=bearer(new["secret"])).status_code == 401
    assert admin.delete("/v1/keys/key_none").status_code == 404


def test_the_last_key_that_manages_keys_stays(as_: As) -> None:
    admin = as_("admin").client
    first = next(key for key in admin.get("/v1/keys").json()["items"] if "admin" in key["scopes"])
    refused = admin.delete(f"/v1/keys/{first['id']}")
    assert (refused.status_code, "make another key" in refused.json()["detail"]) == (409, True)
    assert admin.post("/v1/keys", json={"name": "second", "scopes": ["admin"]}).status_code == 201
    assert admin.delete(f"/v1/keys/{first['id']}").status_code == 200
    assert admin.get("/v1/keys").status_code == 401


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"name": ""},
        {"name": "  "},
        {"name": "x", "scopes": []},
        {"name": "x", "scopes": ["root"]},
        {"name": "x" * 101},
        {"name": "x", "secret": "mine"},
    ],
)
def test_an_invalid_new_key_is_refused(as_: As, body: Json) -> None:
    assert as_("admin").client.post("/v1/keys", json=body).status_code == 422


def test_a_browser_keeps_its_key_where_no_script_reads_it(client: httpx.Client, secrets: dict[str, str]) -> None:
    with httpx.Client(base_url=client.base_url) as browser:
        assert browser.post("/v1/session", json={"key": "wrong"}).status_code == 401
        answer = browser.post("/v1/session", json={"key": secrets["ann"]})
        cookie = answer.headers["Set-Cookie"].lower()
        assert "httponly" in cookie
        assert "samesite=strict" in cookie
        assert secrets["ann"] not in answer.text
        assert browser.get("/v1/session").json()["owner"] == "ann"
        assert browser.get("/v1/runs").status_code == 200
        foreign = {"Origin": "https://evil.example"}
        assert browser.post("/v1/session", json={"key": secrets["ann"]}, headers=foreign).status_code == 403
        assert browser.delete("/v1/session").status_code == 204
        assert browser.get("/v1/runs").status_code == 401


def test_the_client_sends_its_key(
    client: httpx.Client, secrets: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    base = str(client.base_url)
    monkeypatch.delenv("WINGFIT_API_KEY", raising=False)
    with Client(base) as nobody, pytest.raises(WingfitError, match="API key"):
        nobody.runs()
    with Client(base, api_key=secrets["admin"]) as admin:
        key = admin.create_key("bench", scopes=["read"])
        listed = admin.keys()
        assert listed[0]["name"] == "bench"
        admin.revoke_key(key["id"])
    monkeypatch.setenv("WINGFIT_API_KEY", secrets["ann"])
    with Client(base) as ann:
        assert ann.runs() == []
    with pytest.raises(WingfitError, match="WINGFIT_API_KEY"):
        Client(base, api_key="two words")


def test_the_command_line_makes_lists_and_revokes(
    client: httpx.Client, secrets: dict[str, str], monkeypatch: pytest.MonkeyPatch, settings: Settings
) -> None:
    monkeypatch.setenv("WINGFIT_API_KEY", secrets["admin"])
    monkeypatch.setenv("WINGFIT_URL", str(client.base_url))
    runner = CliRunner()
    new = json.loads(runner.invoke(commands, ["keys", "create", "bench", "--scope", "read", "--json"]).stdout)
    assert "bench" in runner.invoke(commands, ["keys", "list"]).stdout
    assert "revoked" in runner.invoke(commands, ["keys", "revoke", new["id"]]).stdout
    assert runner.invoke(commands, ["keys", "create", "x", "--scope", "root"]).exit_code == 2
    busy = runner.invoke(commands, ["keys", "create", "x", "--data", str(settings.data)])
    assert busy.exit_code != 0
    assert "already serves" in str(busy.exception)


def test_the_first_key_is_made_before_the_server_starts(tmp_path: Path) -> None:
    settings = Settings(data=tmp_path, host="0.0.0.0", port=0)  # noqa: S104
    assert settings.keys
    made(tmp_path, "cannot manage keys", "read")
    with pytest.raises(ServeError, match="wingfit keys create NAME --scope admin --data"):
        serve(settings)
    secret = CliRunner().invoke(commands, ["keys", "create", "me", "--scope", "admin", "--data", str(tmp_path)]).stdout
    database = Database(tmp_path)
    app = create_app(settings, database=database, engine=toy.ToyEngine(), make_evaluator=toy.NoEvaluator)
    with serving(app) as client:
        assert client.get("/v1/keys", headers=bearer(secret.strip())).status_code == 200


def test_when_keys_are_required() -> None:
    def asked(**env: str) -> bool:
        return Settings.from_env({f"WINGFIT_{name}": value for name, value in env.items()}).keys

    assert not asked()
    assert asked(REQUIRE_KEYS="1")
    assert asked(HOST="192.168.0.7")
    assert not asked(HOST="192.168.0.7", ALLOW_REMOTE="1")
    with pytest.raises(SettingsError, match="unset one"):
        asked(HOST="192.168.0.7", ALLOW_REMOTE="1", REQUIRE_KEYS="1")


def test_without_keys_data_has_no_owner(tmp_path: Path) -> None:
    with serving(create_app(Settings(data=tmp_path), engine=toy.ToyEngine(), make_evaluator=toy.NoEvaluator)) as client:
        api = Api(client)
        assert api.get("/v1/session") == {"keys_required": False, "key_id": None, "owner": None, "scopes": []}
        dataset = api.upload()["id"]
    secret = {name: made(tmp_path, name, scope) for name, scope in (("ann", "write"), ("admin", "admin"))}
    settings = Settings(data=tmp_path, require_keys=True)
    with serving(create_app(settings, engine=toy.ToyEngine(), make_evaluator=toy.NoEvaluator)) as client:
        assert client.get(f"/v1/datasets/{dataset}", headers=bearer(secret["admin"])).status_code == 200
        assert client.get(f"/v1/datasets/{dataset}", headers=bearer(secret["ann"])).status_code == 403
