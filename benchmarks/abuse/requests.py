"""Hostile bodies, queries, headers and paths, for every operation of the API."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from benchmarks.abuse.cases import Case

Json = dict[str, Any]
EDGES: tuple[Any, ...] = (
    None,
    True,
    -1,
    0,
    2**31,
    2**53,
    2**63,
    -(2**63) - 1,
    2**64,
    10**400,
    1e308,
    -0.0,
    5e-324,
    "",
    " ",
    "\0",
    "\ud800",
    "x" * 100_000,
    "'; DROP TABLE run; --",
    "<script>alert(1)</script>",
    "../../etc/passwd",
    "${jndi:ldap://127.0.0.1/a}",
    [],
    [[]],
    ["x"] * 5000,
    {},
    {"x": {"y": {"z": 1}}},
)
BODIES: Mapping[str, Json] = {
    "/v1/runs": {
        "dataset_id": "{dataset}",
        "division": "4",
        "population": 8,
        "max_generations": 1,
        "stall": 1,
        "seed": 1,
        "genes": ["E_f"],
        "recordings": ["{recording}"],
        "mode": "joint",
        "method": "genetic",
        "effects": [],
        "bounds_factor": 5,
        "accuracy_mm": 0.1,
        "name": "x",
        "finish": False,
    },
    "/v1/runs?": {
        "dataset_id": "{forces}",
        "method": "gauss_newton",
        "mode": "local",
        "axes": ["x"],
        "without": ["clap_and_peel"],
        "preset": "proposed",
        "low_pass_hz": 40.0,
        "peel_width_beats": 0.01,
    },
    "/v1/diagnoses": {
        "dataset_id": "{dataset}",
        "run_id": None,
        "division": "4",
        "suspects": ["added_mass"],
        "refits": 1,
        "refine": False,
        "fixed": {"E_f": 6e6},
        "seed": 1,
        "name": "x",
    },
    "/v1/simulations": {
        "dataset_id": "{dataset}",
        "recording": "{recording}",
        "division": "4",
        "genome": {"E_f": 6e6},
        "effects": [],
        "accuracy_mm": 0.5,
        "outputs": [],
    },
    "/v1/loads": {
        "dataset_id": "{dataset}",
        "recording": "{recording}",
        "division": "4",
        "genome": {},
        "outputs": ["motors"],
        "condition": {"flap_frequency_hz": 3.0},
    },
    "/v1/runs/{run of forces}/predictions": {"flap_frequency_hz": 12.0, "body_pitch_deg": 60.0, "airspeed_m_s": 0.7},
    "/v1/films": {"name": "x", "cameras": ["left", "right"], "rate_hz": {"left": 1000.0}},
    "/v1/keys": {"name": "x", "owner": "x", "scopes": ["read"]},
    "/v1/session": {"key": "x"},
}
TEXTS = (
    b"",
    b"{",
    b"[]",
    b"null",
    b'"x"',
    b"NaN",
    b'{"seed": NaN}',
    b'{"seed": Infinity}',
    b'{"seed": 1e999}',
    b'{"a": 1, "a": 2}',
    b"\xff\xfe{}",
    b"\xef\xbb\xbf{}",
    b'{"\\ud800": 1}',
    b'{"dataset_id": "\\u0000"}',
    b"[" * 100_000,
    b'{"a":' * 50_000,
    b'{"seed": ' + b"9" * 10_000 + b"}",
    b"x" * 1_500_000,
)
GETS = (
    "/v1/runs",
    "/v1/datasets",
    "/v1/diagnoses",
    "/v1/films",
    "/v1/trackings",
    "/v1/runs/{run}/history",
    "/v1/runs/{run}/comparison",
    "/v1/runs/{run}/loads",
    "/v1/runs/{run}/forces",
    "/v1/runs/{run}/export",
    "/v1/effects",
    "/v1/models",
    "/v1/health",
)
QUERIES = (
    "limit=-1",
    "limit=0",
    "limit=99999999999999999999",
    "limit=1e3",
    "limit=",
    "limit=1&limit=2",
    "limit=1&",
    "&limit=1",
    "cursor=",
    "cursor=%00",
    "cursor=YmVmb3JlOjk5OTk5OTk5OTk5OTk5OTk5OTk5",
    "cursor=" + "A" * 5000,
    "after=-1",
    "after=9223372036854775808",
    "after=%F0%9F%92%A9",
    "state=NONE",
    "state=RUNNING%00",
    "dataset_id=%27%20OR%201=1--",
    "recording=%2e%2e%2f",
    "recording=" + "x" * 300,
    "genome=worst",
    "outputs=all&outputs=everything",
    "source=given",
    "format=xlsx",
    "format=csv&format=netcdf",
    "%00=1",
    "a" * 7000 + "=1",
    "=&=&=",
)
IDS = (
    "x",
    "..",
    "%2e%2e",
    "%2e%2e%2f%2e%2e%2fetc%2fpasswd",
    "%00",
    "%ff",
    "%F0%9F%92%A9",
    "' OR 1=1 --",
    "run_" + "0" * 5000,
    "run_0000000000000000",
    "-1",
    "%0d%0aSet-Cookie:%20x=1",
)
PATHS = (
    "/v1/runs/{}",
    "/v1/runs/{}/events",
    "/v1/datasets/{}/archive",
    "/v1/diagnoses/{}/report",
    "/v1/films/{}",
    "/v1/films/{}/frames/left/0",
    "/v1/trackings/{}/tracks.csv",
    "/v1/keys/{}",
    "/{}",
    "/assets/{}",
)
HEADERS: tuple[tuple[str, Mapping[str, str]], ...] = (
    ("key of 5,000", {"Idempotency-Key": "x" * 5000}),
    ("empty key", {"Idempotency-Key": ""}),
    ("event id", {"Last-Event-ID": "-1"}),
    ("event id of 5,000", {"Last-Event-ID": "9" * 5000}),
    ("tags", {"If-None-Match": '"' + "x" * 7000 + '"'}),
    ("range", {"Range": "bytes=0-,0-,0-,0-"}),
    ("origin", {"Origin": "http://evil.example"}),
    ("host", {"Host": "evil.example"}),
    ("empty host", {"Host": ""}),
    ("forwarded", {"X-Forwarded-For": "127.0.0.1", "X-Forwarded-Host": "evil.example", "X-Forwarded-Proto": "x"}),
    ("override", {"X-HTTP-Method-Override": "DELETE"}),
    ("bearer", {"Authorization": "Bearer " + "x" * 7000}),
    ("cookie", {"Cookie": "; ".join(f"c{k}=1" for k in range(500))}),
    ("accept", {"Accept": "application/x-pickle", "Accept-Encoding": "gzip;q=nan"}),
    ("request id", {"X-Request-ID": "x" * 5000}),
)
_GET, _POST = b"GET / HTTP/1.1\r\nHost: localhost\r\n", b"POST /v1/runs HTTP/1.1\r\nHost: localhost\r\n"
_CHUNKED = _POST + b"Transfer-Encoding: chunked\r\n"
RAW = (
    ("not HTTP", b"hello\r\n\r\n"),
    ("TLS", b"\x16\x03\x01\x02\0\1\0\1\xfc\3\3" + b"\0" * 100),
    ("no version", b"GET /\r\n\r\n"),
    ("HTTP/9.9", b"GET / HTTP/9.9\r\nHost: localhost\r\n\r\n"),
    ("two lengths", _POST + b"Content-Length: 2\r\nContent-Length: 5\r\n\r\n{}"),
    ("length and chunks", _CHUNKED + b"Content-Length: 2\r\n\r\n0\r\n\r\n"),
    ("negative length", _POST + b"Content-Length: -1\r\n\r\n"),
    ("wrong length", _POST + b"Content-Length: 100\r\n\r\n{}"),
    ("endless header", _GET + b"X: " + b"x" * 200_000),
    ("many headers", _GET + b"X: 1\r\n" * 5000 + b"\r\n"),
    ("header with a null", _GET + b"X: a\0b\r\n\r\n"),
    ("folded header", b"GET / HTTP/1.1\r\nHost: local\r\n host\r\n\r\n"),
    ("two hosts", _GET + b"Host: evil.example\r\n\r\n"),
    ("absolute path", b"GET http://evil.example/v1/runs HTTP/1.1\r\nHost: localhost\r\n\r\n"),
    ("path with a space", b"GET /v1/runs /x HTTP/1.1\r\nHost: localhost\r\n\r\n"),
    ("path of 100,000", b"GET /" + b"a" * 100_000 + b" HTTP/1.1\r\nHost: localhost\r\n\r\n"),
    ("chunk of a huge size", _CHUNKED + b"\r\nffffffffffffffff\r\n"),
    ("invalid chunk", _CHUNKED + b"\r\nxyz\r\n"),
    ("upgrade", _GET + b"Upgrade: websocket\r\nConnection: Upgrade\r\n\r\n"),
    ("pipelined", b"GET /v1/health HTTP/1.1\r\nHost: localhost\r\n\r\n" * 200),
)


def cases() -> Iterator[Case]:
    """Yield all hostile requests of this module, as cases."""
    for path, good in BODIES.items():
        yield from _bodies(path, good)
    for path in GETS:
        for query in QUERIES:
            yield Case(f"query {query[:30]}", "GET", f"{path}?{query}", answer="any")
    for path in PATHS:
        for name in IDS:
            yield Case(f"id {name[:30]!r}", "GET", path.format(name), answer="any")
            yield Case(f"id {name[:30]!r}", "DELETE", path.format(name), answer="any")
    for what, headers in HEADERS:
        for method, path in (("GET", "/v1/runs/{run}"), ("POST", "/v1/runs")):
            yield Case(f"header: {what}", method, path, {"headers": headers}, answer="any")
    for method in ("PUT", "PATCH", "TRACE", "CONNECT", "PROPFIND", "X" * 100):
        yield Case(f"method {method[:20]}", method, "/v1/runs")
    for what, data in RAW:
        yield Case(f"raw: {what}", raw=data, answer="any")


def _bodies(path: str, good: Json) -> Iterator[Case]:
    if path != "/v1/session":  # whose key is not known here
        yield Case("valid body", "POST", path, _sent(good), answer="accepted")
    for field in good:
        for edge in EDGES:
            # some are valid values of a field, so any answer but 5xx is allowed
            yield _json(f"{field} = {str(edge)[:30]!r}", path, good | {field: edge})
    yield _json("an unknown field", path, good | {"unknown": 1})
    yield _json("every field too many", path, {f"f{k}": k for k in range(5000)})
    for text in TEXTS:
        headers = {"Content-Type": "application/json"}
        yield Case(f"body {text[:20]!r}", "POST", path, {"content": text, "headers": headers})
    for kind in ("text/plain", "application/xml", "application/x-www-form-urlencoded", ""):
        yield Case(f"body called {kind!r}", "POST", path, {"content": b"{}", "headers": {"Content-Type": kind}})


def _json(what: str, path: str, body: Json) -> Case:
    return Case(what, "POST", path, _sent(body), answer="any")


def _sent(body: Json) -> Json:
    text = json.dumps(body).encode()  # ASCII, so that a lone surrogate is escaped
    return {"content": text, "headers": {"Content-Type": "application/json"}}
