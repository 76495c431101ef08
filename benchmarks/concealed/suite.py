"""The whole suite: make and seal, diagnose, record what was advised, open the seals, score.

Processes that make datasets and processes that diagnose are different ones, and the first phase has ended, with the
manifest of hashes closed and told, before the second begins.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from benchmarks.concealed import laboratory, seal
from benchmarks.concealed.answer import Answer
from benchmarks.concealed.score import Mark, blank, mark
from benchmarks.concealed.table import Advised, Table
from benchmarks.concealed.tool import Outcome, Task, run
from benchmarks.concealed.trials import ROOM_K, Trial, any_condition
from records import Condition

if TYPE_CHECKING:
    from benchmarks.concealed.peers import PeerOutcome

In = TypeVar("In")
Out = TypeVar("Out")

SINGLE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
SETTLED = ("named", "measurement fault")
CASES = 40  # ambiguous ones that are followed up, at most


@dataclass(frozen=True)
class Folders:
    """Where a suite keeps what: datasets for the tool, answers under seal, findings."""

    root: Path

    @property
    def datasets(self) -> Path:
        """All that the tool sees."""
        return self.root / "datasets"

    @property
    def sealed(self) -> Path:
        """Answers and manifest."""
        return self.root / "sealed"

    @property
    def findings(self) -> Path:
        """What the tool said, as JSON."""
        return self.root / "findings"

    def dataset(self, label: str) -> Path:
        """Of a trial, or of its repetition."""
        return self.datasets / f"{label}.nc"


@contextmanager
def pool(jobs: int) -> Iterator[ProcessPoolExecutor]:
    """Fresh processes of one thread each."""
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
    executor: ProcessPoolExecutor, work: Callable[[In], Out], items: Iterable[In], label: str, *, quiet: bool = False
) -> list[Out]:
    """Results in the order of ``items``, with progress and the time that is left on standard error."""
    start, running = time.perf_counter(), [executor.submit(work, item) for item in items]
    done: set[Future[Out]] = set()
    for future in as_completed(running):
        done.add(future)
        if not quiet:
            _tell(label, len(done), len(running), time.perf_counter() - start)
    return [future.result() for future in running]


def _tell(label: str, done: int, total: int, seconds: float) -> None:
    left = seconds / done * (total - done)
    end = "\n" if done == total else ""
    note = f"{label}: {done} of {total}, {seconds:.0f} s, about {left:.0f} s left"
    print(f"\r{note:70}", end=end, file=sys.stderr, flush=True)


def make(trials: Sequence[Trial], folders: Folders, jobs: int) -> str:
    """Write the datasets and seal the answers; returns the hash of the manifest."""
    folders.datasets.mkdir(parents=True, exist_ok=True)
    with pool(jobs) as executor:
        orders = [laboratory.Order(trial, folders.dataset(trial.name), folders.sealed) for trial in trials]
        hashes = each(executor, laboratory.make, orders, "recording and sealing")
    return seal.close(dict(zip((t.name for t in trials), hashes, strict=True)), folders.sealed)


def conduct(trials: Sequence[Trial], root: Path, jobs: int, *, peers: bool = False) -> dict[str, Table]:
    """Run the suite in the folder ``root``: tables by method, this project's first."""
    start, folders = time.perf_counter(), Folders(root)
    folders.findings.mkdir(parents=True, exist_ok=True)
    manifest = make(trials, folders, jobs)
    print(f"answers sealed, sha256 of the manifest {manifest}", file=sys.stderr)
    with pool(jobs) as tool:
        outcomes = diagnosed(tool, [(trial, trial.name) for trial in trials], folders, "diagnosing")
        first = {outcome.trial: outcome for outcome in outcomes}
        followed = [trial for trial in trials if _open(trial, first[trial.name])][:CASES]
        second = follow_up(tool, followed, first, folders, jobs)
    seconds = time.perf_counter() - start
    others = _peers(trials, folders, jobs) if peers else {}
    answers = {trial.name: seal.open_seal(trial.name, folders.sealed, manifest) for trial in trials}
    marks = tuple(_marked(first[trial.name], answers[trial.name]) for trial in trials)
    advised = tuple(_advised(one, first[one.name], second, answers[one.name].names) for one in followed)
    asked = sum(trial.group == "advice" for trial in trials)
    return {
        "wingfit": Table(marks, advised, asked, seconds),
        **{name: _table_of_peer(found, answers) for name, found in others.items()},
    }


def _peers(trials: Sequence[Trial], folders: Folders, jobs: int) -> dict[str, list[PeerOutcome]]:
    """What the peers make of the same datasets."""
    from benchmarks.concealed.peers import run as run_peers  # needs the extra [peers]

    with pool(jobs) as executor:
        found = each(executor, run_peers, [task(trial, trial.name, folders) for trial in trials], "peers")
    return {outcomes[0].peer: list(outcomes) for outcomes in zip(*found, strict=True)}


def _table_of_peer(outcomes: Sequence[PeerOutcome], answers: Mapping[str, Answer]) -> Table:
    from benchmarks.concealed.peers import mark as mark_of_peer

    marks = tuple(mark_of_peer(outcome, answers[outcome.trial]) for outcome in outcomes)
    return Table(marks, (), 0, sum(outcome.seconds for outcome in outcomes))


def diagnosed(
    tool: ProcessPoolExecutor, labelled: Sequence[tuple[Trial, str]], folders: Folders, what: str
) -> list[Outcome]:
    """Diagnose the datasets of trials under their labels, and keep the findings."""
    tasks = [task(trial, label, folders) for trial, label in labelled]
    outcomes = each(tool, run, tasks, what)
    for outcome in outcomes:
        kept = asdict(outcome.finding) if outcome.finding else {"failed": outcome.reason}
        (folders.findings / f"{outcome.trial}.json").write_text(json.dumps(kept), encoding="utf-8")
    return outcomes


def task(trial: Trial, label: str, folders: Folders) -> Task:
    """What the user of a trial's rig knows."""
    build = trial.build
    return Task(label, folders.dataset(label), build.division, build.without)


def _open(trial: Trial, outcome: Outcome) -> bool:
    """Whether the tool itself says that it cannot decide between effects, of which one may be hidden by itself."""
    known = trial.group in ("listed", "measurement", "advice")
    return known and outcome.finding is not None and outcome.finding.verdict == "ambiguous"


def follow_up(
    tool: ProcessPoolExecutor, trials: Sequence[Trial], first: dict[str, Outcome], folders: Folders, jobs: int
) -> dict[str, Outcome]:
    """Record each trial's rig once more, as advised and at random, and diagnose again; outcomes by label."""
    wanted = [
        (trial, label, condition)
        for trial in trials
        for label, condition in (
            (f"{trial.name}-advised", _advice(first[trial.name])),
            (f"{trial.name}-random", any_condition(trial, np.random.default_rng([trial.seed, 9]))),
        )
        if condition is not None
    ]
    with pool(jobs) as executor:
        orders = [
            laboratory.Addition(trial, condition, folders.dataset(trial.name), folders.dataset(label), folders.sealed)
            for trial, label, condition in wanted
        ]
        each(executor, laboratory.add, orders, "recording what was advised")
    again = diagnosed(tool, [(trial, label) for trial, label, _ in wanted], folders, "diagnosing again")
    return {outcome.trial: outcome for outcome in again}


def _advice(outcome: Outcome) -> Condition | None:
    """The condition that a finding recommends first; None where it recommends none."""
    if outcome.finding is None or not outcome.finding.advice:
        return None
    best = outcome.finding.advice[0]
    return Condition(
        flap_frequency=best.flap_frequency_hz,
        phase_lag=float(np.radians(best.phase_lag_deg)),
        pressure=100 * best.pressure_mbar,
        temperature=ROOM_K,
        airspeed=best.airspeed,
        angle_of_attack=float(np.radians(best.angle_of_attack_deg)),
    )


def _advised(trial: Trial, first: Outcome, second: dict[str, Outcome], truth: frozenset[str]) -> Advised:
    if first.finding is None:
        raise ValueError(f"{trial.name} was followed up without a finding")

    def settled(label: str) -> bool:
        finding = second[label].finding if label in second else None
        return finding is not None and finding.verdict in SETTLED and set(finding.named) == truth

    return Advised(
        trial.name,
        tuple(sorted(truth)),
        first.finding.verdict,
        first.finding.named,
        first.finding.advice[0].words if first.finding.advice else None,
        settled(f"{trial.name}-advised"),
        settled(f"{trial.name}-random"),
    )


def _marked(outcome: Outcome, answer: Answer) -> Mark:
    if outcome.finding is None:
        return replace(blank(answer, "failed", outcome.reason), seconds=outcome.seconds)
    return replace(mark(outcome.finding, answer), seconds=outcome.seconds)
