"""Clients of a server that is killed: they repeat requests until there is an answer, and record every answer."""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

import httpx
import numpy as np

from benchmarks.common.files import archive
from benchmarks.common.jobs import FINAL
from benchmarks.durability.ledger import KnownRun, Ledger, without_times
from benchmarks.durability.workloads import DIAGNOSED, DIAGNOSIS, WORKS, Work

Json = dict[str, Any]
ACTIVE = 3  # unfinished runs of one client
MOST_DATASETS = 3
MOST_DIAGNOSES = 2  # of all clients
WAIT_SECONDS = 0.02
ANSWERED = frozenset(range(200, 500))


class OverError(Exception):
    """Raised in a client's thread to abandon a request, once :meth:`Client.leave` was called."""


class Client(threading.Thread):
    """Thread that acts as one user at random: uploads, submits, watches, pauses, cancels, and records all answers.

    Each client acts only on runs that it submitted, so that the order of the requests for a run is known. ``number``:
    of the client, from 0; ``port``: of the server; ``expected``: results of undisturbed runs by name of the workload.
    """

    def __init__(self, number: int, seed: int, port: int, ledger: Ledger, expected: Mapping[str, Json]) -> None:
        super().__init__(name=f"client-{number}", daemon=True)
        self._rng, self._ledger, self._expected = np.random.default_rng([seed, number]), ledger, expected
        self._base, self._over, self._requests = f"http://127.0.0.1:{port}", threading.Event(), 0
        self._datasets: dict[str, list[str]] = {work.example: [] for work in WORKS}
        self._mine: list[str] = []
        self.error: BaseException | None = None

    def leave(self) -> None:
        """Make the client stop soon; a request in progress is abandoned."""
        self._over.set()

    def run(self) -> None:
        """Act at random until :meth:`leave` is called; an unexpected exception is stored in ``error``."""
        try:
            with httpx.Client(base_url=self._base, timeout=30.0) as self._http:
                while not self._over.is_set():
                    self._act()
                    time.sleep(WAIT_SECONDS)
        except OverError:
            pass
        except BaseException as error:
            self.error = error
            raise

    # -- actions ---------------------------------------------------------------------------------------------

    def _act(self) -> None:
        open_ = [run for run in self._mine if self._ledger.runs[run].final is None]
        if len(open_) < ACTIVE:
            self._submit(WORKS[self._rng.integers(len(WORKS))])
            return
        run = open_[self._rng.integers(len(open_))]
        acts: list[tuple[Callable[[str], None], float]] = [
            # A run is watched some hundred times, so that most end by themselves.
            (self._look, 0.93),
            (self._diagnose, 0.02),
            (self._pause_and_resume, 0.01),
            (self._cancel, 0.002),
            (self._read_dataset, 0.038),
        ]
        choice = int(self._rng.choice(len(acts), p=[weight for _, weight in acts]))
        acts[choice][0](run)

    def _submit(self, work: Work) -> None:
        dataset = self._dataset(work.example)
        answer = self._ask("POST", "/v1/runs", json=work.body | {"dataset_id": dataset}, repeated=True)
        if answer.status_code != 202:
            raise AssertionError(f"a valid run was refused: {answer.text}")
        run = answer.json()["id"]
        with self._ledger.lock:
            self._ledger.runs[run] = KnownRun(work.name)
        self._mine.append(run)
        self._ledger.acknowledge()

    def _dataset(self, example: str) -> str:
        known = self._datasets[example]
        if len(known) < MOST_DATASETS and (not known or self._rng.random() < 0.1):
            body = archive(example)
            answer = self._ask("POST", "/v1/datasets", files={"file": (f"{example}.zip", body)}, repeated=True)
            if answer.status_code != 201:
                raise AssertionError(f"a valid dataset was refused: {answer.text}")
            known.append(answer.json()["id"])
            with self._ledger.lock:
                self._ledger.datasets[known[-1]] = hashlib.sha256(body).hexdigest()
            self._ledger.acknowledge()
        return known[self._rng.integers(len(known))]

    def _look(self, run: str) -> None:
        now = self._fetch(f"/v1/runs/{run}")
        if now is None:
            self._ledger.lose(f"run {run} is unknown")
            self._ledger.runs[run].final = "LOST"
            return
        items = self._fetch(f"/v1/runs/{run}/history?limit=10000")
        self._ledger.history(run, items["items"] if items else [])
        if now["state"] in FINAL:
            settle(self._ledger, run, now, self._fetch, self._expected)

    def _pause_and_resume(self, run: str) -> None:
        if self._ask("POST", f"/v1/runs/{run}/pause").status_code == 202:
            self._ledger.acknowledge()
        for _ in range(int(self._rng.integers(1, 20))):
            self._look(run)
        # The answer to a completed request may be lost, so the run's state decides whether to repeat it.
        while (now := self._fetch(f"/v1/runs/{run}")) and "PAUSE" in (now["state"][:5], now["pending_action"]):
            if self._ask("POST", f"/v1/runs/{run}/resume").status_code == 202:
                self._ledger.acknowledge()

    def _cancel(self, run: str) -> None:
        known = self._ledger.runs[run]
        known.endings = (*known.endings, "CANCELLED")
        if self._ask("POST", f"/v1/runs/{run}/cancel").status_code == 202:
            known.endings = ("CANCELLED",)
            self._ledger.acknowledge()

    def _diagnose(self, _run: str) -> None:
        dataset, known = self._dataset(DIAGNOSED), list(self._ledger.diagnoses)
        if len(known) < MOST_DIAGNOSES:
            answer = self._ask("POST", "/v1/diagnoses", json=DIAGNOSIS | {"dataset_id": dataset}, repeated=True)
            if answer.status_code != 202:
                raise AssertionError(f"a valid diagnosis was refused: {answer.text}")
            with self._ledger.lock:
                self._ledger.diagnoses[answer.json()["id"]] = None
            self._ledger.acknowledge()
        elif self._fetch(f"/v1/diagnoses/{known[self._rng.integers(len(known))]}") is None:
            self._ledger.lose("a diagnosis is unknown")

    def _read_dataset(self, _run: str) -> None:
        with self._ledger.lock:
            known = list(self._ledger.datasets.items())
        dataset, digest = known[self._rng.integers(len(known))]
        answer = self._ask("GET", f"/v1/datasets/{dataset}/archive")
        if answer.status_code != 200 or hashlib.sha256(answer.content).hexdigest() != digest:
            self._ledger.lose(f"dataset {dataset}: {answer.status_code}, {len(answer.content)} bytes")

    # -- requests, repeated until there is an answer ---------------------------------------------------------

    def _fetch(self, path: str) -> Json | None:
        answer = self._ask("GET", path)
        return dict(answer.json()) if answer.status_code == 200 else None

    def _ask(self, method: str, path: str, *, repeated: bool = False, **more: Any) -> httpx.Response:
        if repeated:
            self._requests += 1
            more["headers"] = {"Idempotency-Key": f"{self.name}-{self._requests}"}
        while not self._over.is_set():
            try:
                answer = self._http.request(method, path, **more)
                if answer.status_code in ANSWERED:
                    return answer
                if answer.status_code not in (502, 503, 504):
                    self._ledger.lose(f"{method} {path}: {answer.status_code} {answer.text[:300]}")
            except httpx.TransportError:
                pass
            time.sleep(WAIT_SECONDS)
        raise OverError


def settle(
    ledger: Ledger, run: str, now: Json, fetch: Callable[[str], Json | None], expected: Mapping[str, Json]
) -> None:
    """Check a finished run, record its loss if its final state is not allowed, and compare its result.

    ``now``: the run as the server describes it; ``fetch``: returns the JSON at a path of the API, or None;
    ``expected``: results of undisturbed runs by name of the workload.
    """
    known = ledger.runs[run]
    if now["state"] not in known.endings:
        ledger.lose(f"run {run} is {now['state']}, must be {' or '.join(known.endings)}: {now['error']}")
    if now["state"] == "SUCCEEDED":
        ledger.result(run, outcome(run, fetch), expected[known.work])
    known.final = now["state"]


def settle_diagnosis(
    ledger: Ledger, diagnosis: str, now: Json, fetch: Callable[[str], Json | None], expected: Json
) -> None:
    """Check a finished diagnosis: it must have succeeded, with the finding ``expected`` of an undisturbed one.

    ``now``: the diagnosis as the server describes it; ``fetch``: as for :func:`settle`.
    """
    if now["state"] != "SUCCEEDED":
        ledger.lose(f"diagnosis {diagnosis} is {now['state']}: {now['error']}")
    else:
        ledger.result(diagnosis, finding(diagnosis, fetch), expected)
    ledger.diagnoses[diagnosis] = now["state"]


def finding(diagnosis: str, fetch: Callable[[str], Json | None]) -> Json:
    """Return the finding of a diagnosis without its duration; ``fetch`` returns the JSON at a path, or None."""
    return {
        key: value for key, value in (fetch(f"/v1/diagnoses/{diagnosis}/finding") or {}).items() if key != "seconds"
    }


def outcome(run: str, fetch: Callable[[str], Json | None]) -> Json:
    """Return the history, genome and result of a successful run, without fields that contain times.

    ``fetch`` returns the JSON at a path of the API, or None.
    """
    history = fetch(f"/v1/runs/{run}/history?limit=10000") or {"items": []}
    return {
        "history": [without_times(item) for item in history["items"]],
        "genome": fetch(f"/v1/runs/{run}/genome"),
        "result": fetch(f"/v1/runs/{run}/result"),
    }
