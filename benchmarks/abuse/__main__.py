"""``python -m benchmarks.abuse --json``: sends malformed and hostile requests to a server, then runs a fuzzer on it.

A request that must be refused must be answered with a 4xx status and a problem document (RFC 9457), and no request with
5xx. In between, the server must answer valid requests, and its memory must stay below ENOUGH_MB.
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
ENOUGH_MB = 1024.0  # largest acceptable peak memory of the server
RAW_SECONDS = 0.5
WORKING = {"WINGFIT_MAX_ACTIVE": "100000", "WINGFIT_MAX_RUNS": "1"}


def main() -> None:
    """Parse the command line, send all requests, and print one JSON object as the last line."""
    options = _options()
    st = None if options.no_fuzz else fuzz.program()
    if st is None and not options.no_fuzz:
        sys.exit(fuzz.MISSING)
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="wf-") as scratch:
        server = Server(Path(scratch), "in_process", settings=WORKING)
        server.start()
        try:
            figures = _measured(server, st, options, Path(scratch))
        finally:
            server.kill()
    figures |= {"seconds": round(time.monotonic() - began, 1), "processor": machine.cpu(), "commit": machine.commit()}
    print(json.dumps(figures))
    sys.exit(1 if figures["server_errors"] or figures["failures"] or figures["peak_rss_mb"] > ENOUGH_MB else 0)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.abuse", description=__doc__)
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line (always printed)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--fuzz-cases", type=int, default=10_000, help="least number of cases of the fuzzer")
    parser.add_argument(
        "--hdf5-files",
        type=int,
        default=hdf5.MUTATED,
        help="number of damaged NetCDF files, in addition to crafted ones",
    )
    parser.add_argument("--no-fuzz", action="store_true", help="do not run the fuzzer")
    return parser.parse_args()


def _measured(server: Server, st: str | None, options: argparse.Namespace, scratch: Path) -> Json:
    with httpx.Client(base_url=f"http://127.0.0.1:{server.port}", timeout=60.0) as http:
        names = valid_inputs.names(http)
        figures = abused(http, server.port, names, [*uploads.cases(options.seed), *requests.cases()])
        files = hdf5.abused(http, server, names, options.seed, options.hdf5_files)
        figures |= files | {"failures": figures["failures"] + files["failures"]}
        if st is not None:
            found = fuzz.fuzzed(st, http, names, options.fuzz_cases, options.seed, scratch)
            figures |= found | {"failures": figures["failures"] + found["failures"]}
    return figures | {"peak_rss_mb": round(server.peak_mb(), 1)}


def abused(http: httpx.Client, port: int, names: dict[str, str], cases: list[Case]) -> Json:
    """Send ``cases`` to the server at ``port``; return the number of answers by status, and a list of failures.

    ``names``: ids of existing objects by placeholder, such as "{run}", which they replace in paths and bodies.
    """
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
    """Send one case; return the status of the answer, and what is wrong with the answer, or "" if nothing is.

    ``names``: as in :func:`abused`. The status is 0 without an answer, and if the HTTP client cannot send the request.
    """
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
        return 0, ""  # an HTTP client cannot send it
    except httpx.TransportError as error:
        return 0, f"no answer: {error!r}"
    return answer.status_code, _wrong(case, answer)


def _wrong(case: Case, answer: httpx.Response) -> str:
    status = answer.status_code
    if status >= 500:
        return f"{status} {answer.text[:300]}"
    if status < 400:
        return f"{status}, but the request must be refused" if case.answer == "refused" else ""
    if case.answer == "accepted":
        return f"{status}, but the request is valid: {answer.text[:300]}"
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
        failures.append(f"after {after.name}: a valid request is answered with {answer.status_code}")
    valid_inputs.cancel_queued(http)


if __name__ == "__main__":
    main()
