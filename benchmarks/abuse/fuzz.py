"""Runs the fuzzer schemathesis on the server's OpenAPI description, with thousands of generated requests.

The check ``positive_data_acceptance`` is excluded: it reports a request of valid form that is answered with 422, which
is right if, for example, its dataset does not exist.

Requests that are meant to be valid get valid values (:mod:`benchmarks.abuse.valid_values`), since most generated ones
would be refused because of their first id. The event stream of a job is read for at most ``STREAM_SECONDS``. Submitted
jobs are cancelled while they wait for a worker; a job that fails by an error of the server counts as a failure too.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx

from benchmarks.abuse import uploads, valid_inputs
from benchmarks.common.files import REPOSITORY, archive

Json = dict[str, Any]
MISSING = "the fuzzer is not installed; install it with pip install -e .[fuzz], or give --no-fuzz"
SPECIFICATION = "/openapi.json"
MISTAKE = "the server made a mistake"
ANSWER_SECONDS, STREAM_SECONDS, RELIEF_SECONDS, ROUND_SECONDS = 60.0, 5.0, 2.0, 7200.0
MOST_ROUNDS = 20
PHASES, FURTHER_PHASES = "examples,coverage,fuzzing,stateful", "fuzzing,stateful"
LONGEST_LINE, LAST_LINES = 200, 400
CONFIGURATION = f"""
request-timeout = {ANSWER_SECONDS}
max-stream-events = 50

[[operations]]
include-path-regex = "/events$"
request-timeout = {STREAM_SECONDS}
"""


def program() -> str | None:
    """Return the path of the program schemathesis: beside this Python, or on PATH; None if it is not installed."""
    beside = Path(sys.executable).with_name("st")
    return str(beside) if beside.is_file() else shutil.which("st")


def fuzzed(st: str, http: httpx.Client, named: dict[str, str], cases: int, seed: int, scratch: Path) -> Json:
    """Fuzz the server with at least ``cases`` requests; return the number of requests and the failures.

    ``st``: path of schemathesis; ``named``: ids of existing objects, of :func:`valid_inputs.names`; ``scratch``: folder
    for temporary files. The same ``seed`` gives the same requests, apart from ids.
    """
    folder = _given(valid_inputs.values(http, named), seed, scratch / "fuzz")
    sent, failures = 0, list[str]()
    with _relieved(str(http.base_url)):
        for report in _rounds(st, http, cases, seed, folder):
            sent += counted(report)
            failures += judged(report)
            print(f"fuzzed {sent} of {cases}", file=sys.stderr, flush=True)
    failures += _mistakes(http)
    if sent < cases:
        failures.append(f"fuzz: {sent} cases in {MOST_ROUNDS} rounds; {cases} are required")
    return {"fuzz_cases": sent, "fuzz_failures": len(failures), "failures": failures}


def counted(report: Json) -> int:
    """Return the number of requests in the JSON ``report`` of one run of schemathesis."""
    return int(report["test_cases"]["generated"])


def judged(report: Json) -> list[str]:
    """Return the failures in the JSON ``report`` of one run of schemathesis, one text each.

    A run that ended early, or did not test every operation of the API, counts as a failure too.
    """
    found = [(one, f" in {', '.join(one['operations'])}") for one in report["failures"]]
    found += [(one, "") for one in report["errors"]]
    failures = [f"fuzz: {one['title']}, {one['count']} times{where}" for one, where in found]
    calls = report["operations"] or {"tested": 0, "total": "all"}
    if not report["complete"] or report["stop_reason"] != "completed":
        failures.append(f"fuzz: ended early, {report['stop_reason']}")
    if calls["tested"] != calls["total"]:
        failures.append(f"fuzz: {calls['tested']} of {calls['total']} calls of the API")
    return failures


def _given(values: Json, seed: int, folder: Path) -> Path:
    """Create ``folder`` with the files that schemathesis and its hooks read, and return it.

    They are the valid ``values`` with the ``seed``, two valid archives to upload, and schemathesis' configuration.
    """
    folder.mkdir()
    (folder / "good.json").write_text(json.dumps({"good": values, "seed": seed}), encoding="utf-8")
    (folder / "tracks.zip").write_bytes(uploads.small_archive())
    (folder / "forces.zip").write_bytes(archive("delfly"))
    (folder / "schemathesis.toml").write_text(CONFIGURATION, encoding="utf-8")
    return folder


def _rounds(st: str, http: httpx.Client, cases: int, seed: int, folder: Path) -> Iterator[Json]:
    """Run schemathesis until it has sent ``cases`` requests, and yield each report; the first run has more phases."""
    url = str(http.base_url.join(SPECIFICATION))
    calls = sum(len(methods) for methods in http.get(SPECIFICATION).json()["paths"].values())
    missing = cases
    for number in range(MOST_ROUNDS):
        phases = FURTHER_PHASES if number else PHASES
        report = _round(st, url, phases, -(-missing // calls), seed + number, folder)
        yield report
        missing -= counted(report)
        if missing <= 0:
            return


def _round(st: str, url: str, phases: str, examples: int, seed: int, folder: Path) -> Json:
    report, log = folder / f"{seed}.json", folder / f"{seed}.log"
    # fmt: off
    command = [
        st, "--config-file", str(folder / "schemathesis.toml"), "--no-color", "run", url, "--phases", phases,
        "--max-examples", str(examples), "--seed", str(seed), "--exclude-checks", "positive_data_acceptance",
        "--continue-on-failure", "--no-shrink", "--generation-database", "none",
        "--report", "json", "--report-json-path", str(report),
    ]
    # fmt: on
    hooks = {"SCHEMATHESIS_HOOKS": "benchmarks.abuse.fuzz_hooks", "WINGFIT_FUZZ_GOOD": str(folder)}
    with log.open("wb") as stream:
        ended = subprocess.run(  # noqa: S603  our own arguments
            command,
            env={**os.environ, "PYTHONPATH": str(REPOSITORY), **hooks},
            cwd=folder,
            stdout=stream,
            stderr=subprocess.STDOUT,
            timeout=ROUND_SECONDS,
            check=False,
        )
    if ended.returncode:
        lines = log.read_text(encoding="utf-8", errors="replace").splitlines()[-LAST_LINES:]
        print("\n".join(line[:LONGEST_LINE] for line in lines), file=sys.stderr)
    if not report.is_file():
        raise RuntimeError(f"schemathesis ended with {ended.returncode} and wrote no report; its output is above")
    written: Json = json.loads(report.read_text(encoding="utf-8"))
    return written


@contextmanager
def _relieved(url: str) -> Iterator[None]:
    """Context manager: during its block, cancel the queued jobs of the server at ``url`` every RELIEF_SECONDS."""
    done = threading.Event()

    def relieve() -> None:
        with httpx.Client(base_url=url, timeout=ANSWER_SECONDS) as http:
            while not done.wait(RELIEF_SECONDS):
                with suppress(httpx.TransportError):  # the fuzzer reports a server that is gone
                    valid_inputs.cancel_queued(http)

    thread = threading.Thread(target=relieve, daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def _mistakes(http: httpx.Client) -> list[str]:
    """Return a description of each job that failed by an error of the server."""
    failed = [one for kind in ("runs", "diagnoses") for one in _all(http, f"/v1/{kind}?state=FAILED&limit=200")]
    return [f"fuzz: {one['id']}: {one['error']}" for one in failed if MISTAKE in (one["error"] or "")]


def _all(http: httpx.Client, path: str) -> Iterator[Json]:
    page = http.get(path).json()
    yield from page["items"]
    while page["next_cursor"]:
        page = http.get(f"{path}&cursor={page['next_cursor']}").json()
        yield from page["items"]
