"""``python -m benchmarks.abuse --json``: a server under malformed and hostile requests, then under a fuzzer.

A request that must be refused is answered with 4xx in the form of a problem, and none with 5xx; the server lives on
and answers good requests in between; its memory stays bounded.
"""

from __future__ import annotations

import argparse
import json
import socket
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any

import httpx

from benchmarks.abuse import fuzz, hdf5, requests, uploads, valid_inputs
from benchmarks.abuse.cases import Case
from benchmarks.common import machine
from benchmarks.common.progress import show
from benchmarks.common.server_process import Server

Json = dict[str, Any]
ENOUGH_MB = 1024.0
RAW_SECONDS = 0.5
WORKING = {"WINGFIT_MAX_ACTIVE": "100000", "WINGFIT_MAX_RUNS": "1"}


def main() -> None:
    """Send everything, and print one JSON object as the last line."""
    asked = _asked()
    st = None if asked.no_fuzz else fuzz.program()
    if st is None and not asked.no_fuzz:
        sys.exit(fuzz.MISSING)
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="wf-") as scratch:
        server = Server(Path(scratch), "in_process", settings=WORKING)
        server.start()
        try:
            told = _told(server, st, asked, Path(scratch))
        finally:
            server.kill()
    told |= {"seconds": round(time.monotonic() - began, 1), "processor": machine.cpu(), "commit": machine.commit()}
    print(json.dumps(told))
    sys.exit(1 if told["server_errors"] or told["failures"] or told["peak_rss_mb"] > ENOUGH_MB else 0)


def _asked() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.abuse", description=__doc__)
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line (always printed)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--fuzz-cases", type=int, default=10_000, help="at least so many cases of the fuzzer")
    parser.add_argument(
        "--hdf5-files", type=int, default=hdf5.MUTATED, help="damaged NetCDF files, besides crafted ones"
    )
    parser.add_argument("--no-fuzz", action="store_true", help="leave the fuzzer out")
    return parser.parse_args()


def _told(server: Server, st: str | None, asked: argparse.Namespace, scratch: Path) -> Json:
    with httpx.Client(base_url=f"http://127.0.0.1:{server.port}", timeout=60.0) as http:
        names = valid_inputs.names(http)
        told = abused(http, server.port, names, [*uploads.cases(asked.seed), *requests.cases()])
        files = hdf5.abused(http, server, names, asked.seed, asked.hdf5_files)
        told |= files | {"failures": told["failures"] + files["failures"]}
        if st is not None:
            found = fuzz.fuzzed(st, http, names, asked.fuzz_cases, asked.seed, scratch)
            told |= found | {"failures": told["failures"] + found["failures"]}
    return told | {"peak_rss_mb": round(server.peak_mb(), 1)}


def abused(http: httpx.Client, port: int, names: dict[str, str], cases: list[Case]) -> Json:
    """How the server at ``port`` answers ``cases``."""
    statuses, failures = Counter[int](), list[str]()
    for number, case in enumerate(cases):
        status, wrong = _sent(http, port, case, names)
        statuses[status] += 1
        if wrong:
            failures.append(f"{case.method} {case.path[:80]}, {case.name}: {wrong}")
        if number % 100 == 0 or number + 1 == len(cases):
            _still_well(http, names, failures, case)
            show(f"hostile requests: {number + 1} of {len(cases)}", last=number + 1 == len(cases))
    errors = sum(count for status, count in statuses.items() if status >= 500)
    counted = {str(status): count for status, count in sorted(statuses.items())}
    return {"cases": len(cases), "server_errors": errors, "failures": failures, "statuses": counted}


def _sent(http: httpx.Client, port: int, case: Case, names: Json) -> tuple[int, str]:
    """Its status (0 where a bare socket got none), and what is wrong with the answer."""
    if case.raw:
        return _raw(port, case.raw), ""
    path, more = case.path, dict(case.more)
    for name, value in names.items():
        path = path.replace(name, value)
        if isinstance(more.get("content"), bytes):
            more["content"] = more["content"].replace(name.encode(), value.encode())
    try:
        answer = http.request(case.method, path, **more)
    except (httpx.InvalidURL, httpx.LocalProtocolError, UnicodeError):
        return 0, ""  # nothing that a client of HTTP can send
    except httpx.TransportError as error:
        return 0, f"no answer: {error!r}"
    return answer.status_code, _wrong(case, answer)


def _wrong(case: Case, answer: httpx.Response) -> str:
    status = answer.status_code
    if status >= 500:
        return f"{status} {answer.text[:300]}"
    if status < 400:
        return f"{status}, though it must be refused" if case.answer == "refused" else ""
    if case.answer == "accepted":
        return f"{status}, though it is good: {answer.text[:300]}"
    if answer.headers.get("Content-Type") != "application/problem+json":
        return f"{status} {answer.headers.get('Content-Type')}: {answer.text[:100]}"
    text = answer.text
    return "a stack trace in the answer" if "Traceback" in text or '.py", line' in text else ""


def _raw(port: int, data: bytes) -> int:
    with socket.create_connection(("127.0.0.1", port), timeout=RAW_SECONDS) as bare, suppress(OSError):
        bare.sendall(data)
        first = bare.recv(4096)
        words = first.split(b" ")
        if len(words) > 1 and words[1].isdigit():
            return int(words[1])
    return 0


def _still_well(http: httpx.Client, names: Json, failures: list[str], after: Case) -> None:
    answer = http.get(f"/v1/runs/{names['{run}']}")
    if answer.status_code != 200:
        failures.append(f"after {after.name}: a good request is answered with {answer.status_code}")
    valid_inputs.cancel_queued(http)


if __name__ == "__main__":
    main()
