"""Defences of the service; docs/security.md names the test of each, and is checked here."""

from __future__ import annotations

import ast
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.oracles.datasets import example_files, zipped, zipped_with
from tests.service import toy
from tests.service.conftest import Api, serving
from wingfit.diagnosis import DiagnosisSpec
from wingfit.importers import inspection
from wingfit.importers import limits as track_limits
from wingfit.records import limits
from wingfit.records.description.schema import dataset_schema
from wingfit.records.files import confined
from wingfit.service import settings
from wingfit.service.app import create_app
from wingfit.service.diagnoses import requests as diagnosis_requests
from wingfit.service.films import files as film_files
from wingfit.service.films import video_process, videos
from wingfit.service.http import concurrency_limit, events, header_limits, request_limits, responses
from wingfit.service.runs import requests, views
from wingfit.service.settings import Settings
from wingfit.sim.wing import division

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "security.md").read_text(encoding="utf-8")
CODE = (
    "records", "importers", "tracking", "cameras", "sim", "checks", "rigs", "inference", "calibration", "diagnosis",
    "planning", "report", "plot", "export", "workers", "service", "client", "cli",
)  # fmt: skip
Schema = dict[str, Any]


# -- answers -----------------------------------------------------------------------------------------------


def test_the_answer_to_an_internal_error_does_not_describe_it(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    app = create_app(Settings(data=tmp_path), engine=toy.FaultyEngine(), make_evaluator=toy.NoEvaluator)
    with serving(app) as client:
        body = {"dataset_id": Api(client).upload()["id"], "recording": "slow"}
        for _ in range(2):  # the connection goes on
            answer = client.post("/v1/simulations", json=body)
            assert (answer.status_code, answer.json()["type"]) == (500, "urn:wingfit:problem:internal")
            assert "nobody's business" not in answer.text
            assert "Traceback" not in answer.text
            assert (
                answer.headers["Content-Security-Policy"] == request_limits.SECURITY_HEADERS["Content-Security-Policy"]
            )
            assert answer.headers["X-Request-ID"]
    assert "nobody's business" in caplog.text  # the log has it


def test_no_other_origin_may_read_an_answer(client: httpx.Client) -> None:
    origin = {"Origin": "https://evil.example"}
    asked = origin | {"Access-Control-Request-Method": "POST", "Access-Control-Request-Headers": "authorization"}
    for answer in (
        client.options("/v1/runs", headers=asked),
        client.get("/v1/runs", headers=origin),
        client.get("/", headers=origin),
    ):
        assert not [name for name in answer.headers if name.startswith("access-control-")]
        assert answer.headers["Cross-Origin-Resource-Policy"] == "same-origin"


def test_no_page_has_an_inline_script(api: Api) -> None:
    diagnosis = api.diagnose(api.upload()["id"])["id"]
    api.diagnosed(diagnosis)
    for path in ("/", "/docs", f"/v1/diagnoses/{diagnosis}/report"):
        answer = api.client.get(path)
        policy = dict(part.strip().split(" ", 1) for part in answer.headers["Content-Security-Policy"].split(";"))
        assert policy.get("script-src", policy["default-src"]) in ("'self'", "'none'"), path
        assert policy.get("object-src", policy["default-src"]) == "'none'", path
        assert policy["base-uri"] == "'none'"
        assert not re.findall(r"<script(?![^>]*\ssrc=)", answer.text), path
        assert not re.findall(r"<[^>]+\son\w+\s*=", answer.text), path
        assert "javascript:" not in answer.text, path


def test_nothing_answers_that_is_not_described(client: httpx.Client) -> None:
    described = set(client.get("/openapi.json").json()["paths"])
    linked = set(re.findall(r'(?:href|src)="([\w./-]+)"', client.get("/").text))
    for path in (
        "/redoc",
        "/swagger",
        "/debug",
        "/admin",
        "/v1",
        "/v2/runs",
        "/metrics",
        "/.env",
        "/app.py",
        "/v1/users",
    ):
        assert path not in described
        assert client.get(path).status_code == 404, path
    styles = {f"{part}style.css" for part in ("", "dataset/", "films/", "importing/", "lists/", "planning/")}
    assert linked <= {"icon.svg", "app.js", "docs"} | styles
    assert all(path.startswith("/v1/") for path in described)


# -- what is done with what is sent ----------------------------------------------------------------------------


def parsed() -> Iterator[tuple[str, ast.AST]]:
    for part in CODE:
        for path in (ROOT / part).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                yield path.relative_to(ROOT).as_posix(), node


def test_nothing_that_was_sent_or_stored_is_unpickled_or_executed() -> None:
    risky = re.compile(
        r"(?:pickle|dill|marshal|cloudpickle|shelve)\.(?:loads?|Unpickler|open)|eval|exec|yaml\.load|np\.load"
    )
    calls = {(path, ast.unparse(node.func)) for path, node in parsed() if isinstance(node, ast.Call)}
    assert {(path, call) for path, call in calls if risky.fullmatch(call)} == {
        ("workers/ray_cluster.py", "pickle.loads"),  # from the process that owns the worker
        ("workers/processes.py", "pickle.loads"),  # what it wrote itself
        ("sim/kernels/lanes/vector.py", "exec"),  # a text of its own, when it is imported
        ("export/fmu/wing.py", "exec"),  # a text of its own: names of arrays and numbers of the layout of memory
        ("export/fmu/vehicle.py", "exec"),  # the same
        # arrays alone, without pickles
        ("tracking/marker_noise.py", "np.load"),
        ("importers/readers/sleap.py", "np.load"),
        ("cameras/markers/stored.py", "np.load"),
    }


def test_the_server_loads_no_http_client() -> None:
    clients = (
        "httpx",
        "requests",
        "aiohttp",
        "httpcore",
        "ftplib",
        "wingfit.client.transport",
        "wingfit.client.client",
    )
    code = f"import sys, wingfit.service.server; print([m for m in {clients} if m in sys.modules])"
    told = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert told.stdout.strip() == "[]"
    called = {
        path for path, node in parsed() if isinstance(node, ast.Attribute) and node.attr in ("urlopen", "urlretrieve")
    }
    assert called == set()


def test_a_submitted_address_is_not_opened(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as trap:
        trap.settimeout(0.5)
        url = f"http://127.0.0.1:{trap.getsockname()[1]}/x"
        with serving(create_app(Settings(data=tmp_path), make_evaluator=toy.NoEvaluator)) as client:
            archive = example_files() | {"recordings/link.url": url.encode()}
            archive["dataset.yaml"] = archive["dataset.yaml"].replace(b"name: robird-11", f"name: {url}".encode())
            sent = {"file": (url, zipped(archive))}
            client.post("/v1/datasets", files=sent, headers={"Referer": url, "X-Forwarded-Host": url})
            for path in ("runs", "diagnoses", "simulations", "loads"):
                body = {"dataset_id": url, "recording": url, "name": url, "run_id": url}
                assert client.post(f"/v1/{path}", json=body).status_code == 422
            client.get(f"/v1/effects/{url}")
            client.get("/v1/runs", params={"dataset_id": url, "callback": url})
        with pytest.raises(TimeoutError):
            trap.accept()


def test_an_upload_does_not_name_files(tmp_path: Path) -> None:
    with serving(create_app(Settings(data=tmp_path / "data"), make_evaluator=toy.NoEvaluator)) as client:
        for filename in ("../../evil.zip", "/etc/evil.zip", "evil.zip", "..\\evil.zip"):
            data = zipped_with(example_files(), "evil/evil.csv")
            answer = client.post("/v1/datasets", files={"file": (filename, data)})
            assert answer.status_code == 201, answer.text
            told = client.get(f"/v1/datasets/{answer.json()['id']}/archive").headers["Content-Disposition"]
            assert "evil" not in told
    assert {path.name for path in tmp_path.rglob("*")} <= {
        "data", "wingfit.lock", "wingfit.sqlite3", "wingfit.sqlite3-wal", "wingfit.sqlite3-shm",
    }  # fmt: skip


# -- limits ------------------------------------------------------------------------------------------------------


def unbounded(schema: Schema, known: Schema, where: str) -> Iterator[str]:
    """Places in ``schema`` where a request may be as long as it likes."""
    if "$ref" in schema:
        schema = known[schema["$ref"].rpartition("/")[2]]
    for one in (*schema.get("anyOf", ()), *schema.get("oneOf", ()), *schema.get("allOf", ())):
        yield from unbounded(one, known, where)
    kind, more = schema.get("type"), schema.get("additionalProperties", True)
    if kind == "string" and not {"enum", "const", "maxLength"} & set(schema):
        yield where
    if kind == "array":
        yield from [] if "maxItems" in schema else [where]
        yield from unbounded(schema["items"], known, f"{where}[]")
    if kind == "object":
        yield from [] if more is False or "maxProperties" in schema else [where]
        for name, one in schema.get("properties", {}).items():
            yield from unbounded(one, known, f"{where}.{name}")


def test_every_field_of_bodies_and_queries_has_a_limit(client: httpx.Client) -> None:
    specification = client.get("/openapi.json").json()
    known = specification["components"]["schemas"]
    found, bodies = list[str](), 0
    for path, methods in specification["paths"].items():
        for method, operation in methods.items():
            for parameter in operation.get("parameters", ()):
                if parameter["in"] == "query":
                    found += unbounded(parameter["schema"], known, f"{method} {path} {parameter['name']}")
            body = operation.get("requestBody", {}).get("content", {}).get("application/json")
            bodies += body is not None
            found += unbounded(body["schema"], known, f"{method} {path}") if body else []
    assert found == []
    assert bodies >= 7


def test_every_list_of_a_dataset_has_a_limit() -> None:
    schema = dataset_schema()
    lists = [one for one in _all(schema) if one.get("type") == "array"]
    assert len(lists) > 8
    assert not [one for one in lists if "maxItems" not in one]


def _all(schema: Any) -> Iterator[Schema]:
    if isinstance(schema, dict):
        yield schema
    for one in schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ():
        yield from _all(one)


def listed(model: Any, name: str) -> int:
    return int(next(one.max_length for one in model.model_fields[name].metadata if hasattr(one, "max_length")))


def highest(model: Any, name: str) -> int:
    return int(next(one.le for one in model.model_fields[name].metadata if hasattr(one, "le")))


def test_the_documented_limits_are_those_of_the_code() -> None:
    rows = dict(re.findall(r"^\| ([^|]+?) \| ([\d,]+)[^|]*\|", PAGE.partition("## Limits")[2], re.MULTILINE))
    run, diagnosis = requests.RunIn, diagnosis_requests.DiagnosisIn
    in_force = {
        "request line and headers": header_limits.HEAD_LIMIT // 2**10,
        "body of an upload, or of a file of a tracking system": request_limits.UPLOAD_LIMIT // 2**20,
        "any other body": request_limits.BODY_LIMIT // 2**20,
        "unpacked archive": limits.MAX_EXPANDED_BYTES // 2**20,
        "unpacked over packed size, of an upload of more than 16 MiB unpacked": limits.MAX_COMPRESSION_RATIO,
        "entries of an archive": limits.MAX_ENTRIES,
        "`dataset.yaml`": limits.MAX_DESCRIPTION_BYTES // 2**20,
        "levels of `dataset.yaml`": limits.MAX_DEPTH,
        "keys, items and values of `dataset.yaml`": limits.MAX_ITEMS,
        "recordings": limits.MAX_RECORDINGS,
        "rows of a recording": limits.MAX_ROWS,
        "markers": limits.MAX_MARKERS,
        "numbers of a dataset": limits.MAX_VALUES,
        "numbers of a NetCDF upload": limits.MAX_UPLOADED_NETCDF_VALUES,
        "memory to read a NetCDF upload": confined.limits_of_upload(0).memory_mib,
        "processor time to read a NetCDF upload": confined.limits_of_upload(0).processor_s,
        "time to read a NetCDF upload": confined.limits_of_upload(request_limits.UPLOAD_LIMIT).wall_s,
        "bodies of a discretisation": division.MAX_BODIES,
        "genes in a request": listed(run, "genes"),
        "recordings in a request": listed(run, "recordings"),
        "effects in a request": listed(run, "effects"),
        "suspects of a diagnosis": listed(diagnosis, "suspects"),
        "effects that a diagnosis refits": highest(diagnosis, "refits"),
        "population": highest(run, "population"),
        "generations of a stage": highest(run, "max_generations"),
        "items on a page": responses.LARGEST_PAGE,
        "generations on a page of a history": responses.LARGEST_HISTORY_PAGE,
        "recorded coordinates in an answer": views.MOST_COORDINATES,
        "frames of a preview of imported tracks": inspection.PREVIEW_FRAMES,
        "positions of a preview of imported tracks": inspection.PREVIEW_POSITIONS,
        "numbers of a file of a tracking system": track_limits.MAX_TRACK_VALUES,
        "concurrent simulations": concurrency_limit.SIMULATIONS,
        "concurrently read uploads and files of tracking systems": concurrency_limit.UPLOADS,
        "concurrent NetCDF exports": concurrency_limit.EXPORTS,
        "concurrent downloads of archives, exports, findings, reports and histories": concurrency_limit.DOWNLOADS,
        "simulated answers and imported tracks sent concurrently": concurrency_limit.ANSWERS,
        "requests waiting for each of these": concurrency_limit.MAX_WAITING,
        "concurrent backups": concurrency_limit.BACKUPS,
        "requests waiting for a backup": concurrency_limit.MAX_WAITING_BACKUPS,
        "slowest accepted client": header_limits.SLOWEST_BYTES_PER_SECOND // 2**10,
        "event streams": events.MAX_STREAMS,
        "unfinished jobs of an owner": settings.Settings.max_active,
        "concurrently computed jobs": settings.Settings.max_runs,
        "MB of archives of an owner": settings.Settings.max_stored_mb,
        "MiB of a video": settings.Settings.max_film_mib,
        "MiB of all videos of an owner": settings.Settings.max_films_mib,
        "free disk beside films": film_files.RESERVED_MIB,
        "concurrently received files of films": concurrency_limit.FILM_UPLOADS,
        "silence of a client that uploads one": int(film_files.SILENT_SECONDS),
        "concurrently read frames": concurrency_limit.FRAMES,
        "time to read a frame": int(videos.SECONDS),
        "memory of the process that reads frames": video_process.MEMORY_MIB // 2**10,
    }
    assert {name: int(value.replace(",", "")) for name, value in rows.items()} == in_force
    assert f"KiB/s over {header_limits.SLOW_SECONDS:g} s" in PAGE
    assert DiagnosisSpec().refits <= in_force["effects that a diagnosis refits"]


# -- the page ----------------------------------------------------------------------------------------------------


def test_every_test_that_the_page_names_exists() -> None:
    named = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", PAGE)
    assert len(named) > 40
    for path, function in set(named):
        assert re.search(rf"^def {function}\(", (ROOT / path).read_text(encoding="utf-8"), re.MULTILINE), (
            path,
            function,
        )


def test_the_page_answers_all_ten_items_and_names_tests() -> None:
    rows = re.findall(r"^\| API(\d+) [^|]*\|([^|]*)\|([^|]*)\|$", PAGE, re.MULTILINE)
    assert [int(number) for number, _, _ in rows] == list(range(1, 11))
    for number, answer, shown in rows:
        assert len(answer) > 100, number
        assert "::" in shown, number


def test_a_setting_that_limits_is_documented() -> None:
    page = (ROOT / "docs" / "deployment.md").read_text(encoding="utf-8")
    known = set(re.findall(r"WINGFIT_[A-Z_]+", (ROOT / "service" / "settings.py").read_text(encoding="utf-8")))
    assert {name for name in known if f"| `{name}` |" not in page} == set()
