"""Runs steps of the blind test in parallel: where its files are, the pool of processes, and stored diagnoses."""

from __future__ import annotations

import json
import multiprocessing
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from benchmarks.common.progress import show_count
from benchmarks.concealed.run_diagnosis import Outcome, Task, run
from benchmarks.concealed.trials import Trial
from wingfit.report import finding_from_json, finding_json

In = TypeVar("In")
Out = TypeVar("Out")

SINGLE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


@dataclass(frozen=True)
class Folders:
    """Where a suite stores datasets, sealed answers and findings."""

    root: Path

    @property
    def datasets(self) -> Path:
        """Folder of the datasets, the only files that the diagnosis reads."""
        return self.root / "datasets"

    @property
    def sealed(self) -> Path:
        """Folder of the sealed answers and of the manifest with their hashes."""
        return self.root / "sealed"

    @property
    def findings(self) -> Path:
        """Folder of the findings of the diagnosis, as JSON."""
        return self.root / "findings"

    @property
    def peers(self) -> Path:
        """Folder of the results of the comparison methods, as JSON."""
        return self.root / "peers"

    def answer(self, trial: str) -> Path:
        """Path of the sealed answer of ``trial``."""
        return self.sealed / f"{trial}.json"

    def dataset(self, label: str) -> Path:
        """Path of the dataset ``label``: that of a trial, or its copy extended by one more recording."""
        return self.datasets / f"{label}.nc"


@contextmanager
def pool(jobs: int) -> Iterator[ProcessPoolExecutor]:
    """Pool of ``jobs`` new processes in which numerical libraries use one thread each."""
    before = {name: os.environ.get(name) for name in SINGLE_THREAD}
    os.environ.update(dict.fromkeys(SINGLE_THREAD, "1"))
    try:
        with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as executor:
            yield executor
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def each(
    executor: Executor,
    work: Callable[[In], Out],
    items: Iterable[In],
    label: str,
    keep: Callable[[Out], None] | None = None,
) -> list[Out]:
    """Call ``work`` on each of ``items`` in parallel; returns the results in the order of ``items``.

    ``keep`` is called with each result as soon as it is available. Progress and remaining time, under the name
    ``label``, go to standard error.
    """
    start, running = time.monotonic(), [executor.submit(work, item) for item in items]
    done: set[Future[Out]] = set()
    for future in as_completed(running):
        done.add(future)
        if keep:
            keep(future.result())
        show_count(label, len(done), len(running), start)
    return [future.result() for future in running]


def diagnosed(tool: Executor, tasks: Sequence[Task], folders: Folders, what: str) -> list[Outcome]:
    """Run the diagnoses ``tasks`` and store the findings; returns the outcomes in the same order.

    ``what`` names the step in the progress display. Findings of an earlier run are used again.
    """
    stored = {one.trial: found for one in tasks if (found := _stored(one, folders)) is not None}

    def keep(outcome: Outcome) -> None:
        stored[outcome.trial] = outcome
        path = folders.findings / f"{outcome.trial}.json"
        content = finding_json(outcome.finding) if outcome.finding else {"failed": outcome.reason}
        path.with_suffix(".part").write_text(json.dumps(content), encoding="utf-8")
        path.with_suffix(".part").replace(path)

    each(tool, run, [one for one in tasks if one.trial not in stored], what, keep)
    return [stored[one.trial] for one in tasks]


def _stored(request: Task, folders: Folders) -> Outcome | None:
    """The finding of an earlier run on the same dataset.

    None if there is none or if it failed, so that it is tried again.
    """
    path = folders.findings / f"{request.trial}.json"
    if not path.exists() or path.stat().st_mtime < request.dataset.stat().st_mtime:
        return None
    stored = json.loads(path.read_text(encoding="utf-8"))
    if "failed" in stored:
        return None
    finding = finding_from_json(stored)
    return Outcome(request.trial, finding, "", finding.seconds)


def task(trial: Trial, label: str, folders: Folders) -> Task:
    """The diagnosis request for the dataset ``label`` of a trial: only what a user would know, without the answer."""
    build = trial.build
    return Task(label, folders.dataset(label), build.division, build.without, effects=build.effects)
