"""Hosts, origins, sizes and security headers of requests; unknown paths; some settings."""

from __future__ import annotations

import socket
import time
from pathlib import Path

import httpx
import pytest

from tests.service.conftest import Api, metrics
from tests.service.processes import ServerProcess
from wingfit.service.http.header_limits import HEAD_LIMIT
from wingfit.service.settings import Settings, SettingsError


@pytest.fixture(scope="module")
def client(shared: tuple[Api, str]) -> httpx.Client:
    """Of one server for all: hardly any of these requests changes anything, and none what another expects."""
    return shared[0].client


@pytest.mark.parametrize(("host", "status"), [("localhost", 200), ("LOCALHOST:99", 200), ("[::1]:8321", 200)])
def test_loopback_host_names_are_accepted(client: httpx.Client, host: str, status: int) -> None:
    assert client.get("/v1/health", headers={"Host": host}).status_code == status


OTHER_HOSTS = ["evil.example", "evil.example:8321", "127.0.0.1.evil.example", "[", "192.168.0.1", ""]


@pytest.mark.parametrize("host", OTHER_HOSTS)
def test_other_host_names_are_refused(client: httpx.Client, host: str) -> None:
    for path in ("/v1/runs", "/", "/openapi.json", "/v1/session", "/v1/healthy", "/v1/health/", "/v1/metrics/x"):
        answer = client.get(path, headers={"Host": host})
        assert (answer.status_code, answer.headers["Content-Type"]) == (400, "application/problem+json"), path
        assert "WINGFIT_ALLOWED_HOSTS" in answer.json()["detail"]
    for path in ("/v1/health", "/v1/runs"):
        assert client.post(path, headers={"Host": host}).json()["type"] == "urn:wingfit:problem:host"


@pytest.mark.parametrize("host", OTHER_HOSTS)
def test_probes_are_answered_by_any_name(client: httpx.Client, host: str) -> None:
    while client.get("/v1/ready").status_code != 200:
        time.sleep(0.01)
    for method in ("GET", "HEAD"):
        answers = [client.request(method, path, headers={"Host": host}) for path in ("/v1/health", "/v1/ready")]
        for answer in (*answers, metrics(client, method, Host=host)):
            assert answer.status_code == 200, answer.url
            assert answer.headers["X-Frame-Options"] == "DENY"


def test_a_probe_without_a_host_is_answered(client: httpx.Client) -> None:
    """As some load balancers send it."""
    with socket.create_connection(("127.0.0.1", client.base_url.port), timeout=60.0) as plain:
        plain.sendall(b"GET /v1/health HTTP/1.0\r\n\r\n")
        assert plain.recv(1000).split(b"\r\n")[0] == b"HTTP/1.1 200 OK"


def test_a_page_of_another_site_changes_nothing(api: Api) -> None:
    own = str(api.client.base_url).rstrip("/")
    run = {"dataset_id": api.upload()["id"], "max_generations": 1}
    before = len(api.get("/v1/runs")["items"])
    for headers in (
        {"Origin": "https://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:1"},
        {"Sec-Fetch-Site": "cross-site"},
    ):
        assert api.client.post("/v1/runs", json=run, headers=headers).status_code == 403, headers
    assert len(api.get("/v1/runs")["items"]) == before
    assert api.client.post("/v1/runs", json=run, headers={"Origin": own}).status_code == 202


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "https://evil.example"},
        {"Origin": "null"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},  # another port of this machine
    ],
)
def test_a_page_of_another_site_reads_nothing(api: Api, headers: dict[str, str]) -> None:
    run = api.submit(api.upload()["id"])["id"]
    api.finish(run)
    for path in ("/v1/runs", f"/v1/runs/{run}", "/v1/backup", "/v1/health", f"/v1/runs/{run}/export?format=netcdf"):
        for _ in range(2):  # also where the headers are known from before
            answer = api.client.get(path, headers=headers)
            assert (answer.status_code, answer.json()["type"]) == (403, "urn:wingfit:problem:origin"), path
            assert api.client.get(path).status_code == 200
            assert api.client.head(path, headers=headers).status_code == 403
    for path in ("/", "/docs", "/icon.svg", "/openapi.json"):  # links lead to the page, which holds no data
        assert api.client.get(path, headers=headers).status_code == 200, path


def test_the_own_page_and_typed_addresses_may_read(api: Api) -> None:
    own = str(api.client.base_url).rstrip("/")
    for headers in ({"Sec-Fetch-Site": "same-origin"}, {"Sec-Fetch-Site": "none"}, {"Origin": own}, {}):
        assert api.client.get("/v1/runs", headers=headers).status_code == 200, headers


def test_a_large_body_is_refused_where_no_file_is_expected(client: httpx.Client) -> None:
    answer = client.post("/v1/runs", content=b" " * (2**20 + 1), headers={"Content-Type": "application/json"})
    assert (answer.status_code, answer.json()["type"]) == (413, "urn:wingfit:problem:too-large")


@pytest.mark.parametrize("path", ["/v1/health", "/docs", "/v1/nothing", "/assets/plotly.min.js"])
def test_every_answer_carries_the_security_headers(client: httpx.Client, path: str) -> None:
    headers = client.get(path).headers
    assert "default-src 'self'" in headers["Content-Security-Policy"]
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["X-Frame-Options"] == "DENY"


def test_a_request_whose_head_does_not_end_is_refused_and_the_next_ones_are_not(tmp_path: Path) -> None:
    with ServerProcess(tmp_path / "data", ("tests.service.toy_server", "0")) as server:
        with socket.create_connection(("127.0.0.1", server.port), timeout=60.0) as endless:
            endless.sendall(b"GET /v1/health HTTP/1.1\r\nHost: localhost\r\nX-Long: ")
            endless.sendall(b"x" * (HEAD_LIMIT + 1))
            assert endless.recv(1000).startswith(b"HTTP/1.1 400 ")
        assert server.client.request("X" * 100, "/v1/runs").json()["type"] == "urn:wingfit:problem:not-http"
        with socket.create_connection(("127.0.0.1", server.port), timeout=60.0) as trailing:
            trailing.sendall(
                b"POST /v1/runs HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n2\r\n{}\r\n0\r\n"
            )
            with pytest.raises(ConnectionError):  # hung up on
                trailing.sendall(b"X-Trailer: x\r\n" * 10**6)
        pieces = (b" " * 3 for _ in range(HEAD_LIMIT))  # each in a frame of its own, together far more than the limit
        assert server.client.post("/v1/runs", content=pieces).status_code == 422
        body = b" " * (4 * HEAD_LIMIT)
        for _ in range(3):
            assert server.client.post("/v1/runs", content=body).status_code == 422
        long = {"X-Long": "x" * (HEAD_LIMIT // 2)}
        assert [server.client.get("/v1/health", headers=long).status_code for _ in range(4)] == [200] * 4


@pytest.mark.parametrize("upgrade", ["", "Connection: Upgrade\r\nUpgrade: x\r\n"])
def test_a_body_is_never_taken_for_a_request(client: httpx.Client, upgrade: str) -> None:
    """Also where the client asks for an upgrade, which the server does not support."""
    host = f"Host: 127.0.0.1:{client.base_url.port}\r\n"
    hidden = f"GET /v1/runs HTTP/1.1\r\n{host}\r\n"
    with socket.create_connection(("127.0.0.1", client.base_url.port), timeout=60.0) as plain:
        plain.sendall(
            f"POST /v1/runs HTTP/1.1\r\n{host}{upgrade}Content-Length: {len(hidden)}\r\n\r\n{hidden}".encode()
        )
        plain.shutdown(socket.SHUT_WR)
        answers = b""
        while more := plain.recv(65536):
            answers += more
    assert (answers.count(b"HTTP/1.1 "), answers.startswith(b"HTTP/1.1 422 ")) == (1, True)


@pytest.mark.parametrize("origin", ["http://[", "http://[::1", "null", "http://evil.example", "//", ""])
def test_an_invalid_origin_counts_as_foreign(client: httpx.Client, origin: str) -> None:
    answer = client.post("/v1/runs", json={}, headers={"Origin": origin})
    assert (answer.status_code, answer.json()["status"]) == (403, 403)
    assert answer.headers["X-Frame-Options"] == "DENY"


def test_unknown_paths_are_404_and_unknown_methods_405(client: httpx.Client) -> None:
    assert client.get("/v1/nothing").status_code == 404
    assert client.get("/v1/runs/x/y/z").json()["type"] == "urn:wingfit:problem:not-found"
    answer = client.put("/v1/runs")
    assert (answer.status_code, answer.headers["Allow"]) == (405, "GET, HEAD, POST")
    assert client.get("/../../etc/passwd").status_code == 404
    assert client.get("/%2e%2e/app.py").status_code == 404


def test_a_head_is_a_get_without_its_body(api: Api) -> None:
    run = api.submit(api.upload()["id"])["id"]
    api.finish(run)
    for path in ("/", f"/v1/runs/{run}", "/v1/runs", f"/v1/runs/{run}/result", "/v1/runs/run_none"):
        head, get = api.client.head(path), api.client.get(path)
        assert (head.status_code, head.content) == (get.status_code, b""), path
        assert head.headers.get("ETag") == get.headers.get("ETag")
        assert head.headers["Content-Length"] == get.headers["Content-Length"]
    assert api.client.head(f"/v1/runs/{run}/events").status_code == 405


def test_a_misspelt_query_parameter_is_refused(client: httpx.Client) -> None:
    answer = client.get("/v1/runs", params={"stat": "RUNNING", "limit": 3})
    assert answer.status_code == 422
    (fault,) = answer.json()["errors"]
    assert (fault["where"], fault["value"]) == ("query.stat", "RUNNING")
    assert "active, badge, cursor, dataset_id, limit, order, q, sort, state" in fault["message"]
    assert client.get("/v1/health", params={"x": "1"}).status_code == 422
    assert client.get("/", params={"x": "1"}).status_code == 200


def test_plotly_is_served_by_this_server(client: httpx.Client) -> None:
    answer = client.get("/assets/plotly.min.js")
    assert answer.status_code == 200
    assert answer.headers["Content-Type"].startswith("text/javascript")
    assert len(answer.content) > 10**6


def test_remote_addresses_need_keys_or_consent() -> None:
    assert Settings.from_env({"WINGFIT_HOST": "0.0.0.0"}).keys  # noqa: S104
    allowed = {"WINGFIT_HOST": "0.0.0.0", "WINGFIT_ALLOW_REMOTE": "1", "WINGFIT_ALLOWED_HOSTS": "api, Rig.local"}  # noqa: S104
    settings = Settings.from_env(allowed)
    assert settings.allowed_hosts == ("localhost", "127.0.0.1", "::1", "api", "rig.local")
    assert settings.url == "http://localhost:8321/"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("WINGFIT_PORT", "eighty"),
        ("WINGFIT_PORT", "65536"),
        ("WINGFIT_MAX_RUNS", "0"),
        ("WINGFIT_WORKERS", "0"),
        ("WINGFIT_EVALUATOR", "dask"),
    ],
)
def test_an_invalid_setting_is_named(name: str, value: str) -> None:
    with pytest.raises(SettingsError, match=name):
        Settings.from_env({name: value})


def test_a_ray_address_needs_the_ray_evaluator() -> None:
    with pytest.raises(SettingsError, match="WINGFIT_EVALUATOR is 'processes': set that to ray"):
        Settings.from_env({"WINGFIT_RAY_ADDRESS": "h:1", "WINGFIT_EVALUATOR": "processes"})


@pytest.mark.parametrize("folder", ["~no-such-user/x", "a-\udcff"])
def test_an_invalid_folder_is_refused(folder: str) -> None:
    with pytest.raises(SettingsError, match=r"WINGFIT_DATA is .*write its whole path"):
        Settings.from_env({"WINGFIT_DATA": folder})


def test_settings_come_from_the_environment() -> None:
    read = Settings.from_env({"WINGFIT_DATA": "/d", "WINGFIT_WORKERS": "3", "WINGFIT_RAY_ADDRESS": "h:1"})
    assert (read.data, read.port, read.workers, read.ray_address, read.evaluator) == (Path("/d"), 8321, 3, "h:1", "ray")
