"""Runs the whole blind test: make datasets and answers, diagnose, follow the advice, compare with the answers, score.

Datasets are made and diagnosed in different processes. All answers are complete, and the hash of their manifest is
printed, before the first diagnosis begins.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.concealed import exhaustive, record_trial, seal
from benchmarks.concealed.answer import Answer
from benchmarks.concealed.run_diagnosis import Outcome, Task
from benchmarks.concealed.running import Folders, diagnosed, each, pool, task
from benchmarks.concealed.score import Mark, failed, mark
from benchmarks.concealed.table import Advised, Table
from benchmarks.concealed.trials import ROOM_K, Trial, any_condition
from wingfit.diagnosis.finding import NAMING
from wingfit.records import Condition, load_dataset

if TYPE_CHECKING:
    from benchmarks.concealed.peers import PeerOutcome

CASES = 60  # most ambiguous trials that are followed up


def make(trials: Sequence[Trial], folders: Folders, jobs: int) -> str:
    """Make the datasets and answers of ``trials``, in ``jobs`` processes; returns the hash of the answers' manifest.

    Trials that ``folders`` already hold, made with the same seed, are not made again.
    """
    folders.datasets.mkdir(parents=True, exist_ok=True)
    missing = [trial for trial in trials if not _made(trial, folders)]
    with pool(jobs) as executor:
        orders = [record_trial.Order(trial, folders.dataset(trial.name), folders.sealed) for trial in missing]
        each(executor, record_trial.make, orders, "recording and sealing")
    hashes = {trial.name: seal.digest(folders.answer(trial.name).read_text(encoding="utf-8")) for trial in trials}
    return seal.close(hashes, folders.sealed)


def _made(trial: Trial, folders: Folders) -> bool:
    """Whether ``folders`` hold this trial; ValueError if they hold a different trial of the same name."""
    if not (folders.answer(trial.name).exists() and folders.dataset(trial.name).exists()):
        return False
    earlier = seal.read(folders.answer(trial.name))
    stored, requested = (
        (earlier.seed, earlier.names, earlier.plant, earlier.target),
        (trial.seed, frozenset((*trial.hidden, *trial.build.by_nature))),
    )
    if stored != (*requested, trial.build.plant, trial.target):
        raise ValueError(
            f"{folders.root} holds {trial.name} with seed {earlier.seed}, but seed {trial.seed} is requested: "
            "give an empty folder, or run the suite that it was made for"
        )
    return True


def conduct(
    trials: Sequence[Trial], root: Path, jobs: int, *, peers: bool = False, before: Table | None = None
) -> dict[str, Table]:
    """Run the test of ``trials`` in the folder ``root``, with ``jobs`` processes.

    Returns the scores by method: "wingfit", the diagnosis, first, then with ``peers`` the comparison methods. Scores
    ``before``, of other trials, only count towards the largest numbers of trials that are followed up and compared.
    """
    followed_before, compared_before = (before.advised, before.compared_by_rig) if before else ((), {})
    start, folders = time.perf_counter(), Folders(root)
    folders.findings.mkdir(parents=True, exist_ok=True)
    manifest = make(trials, folders, jobs)
    print(f"answers sealed; SHA-256 of the manifest: {manifest}", file=sys.stderr)
    with pool(jobs) as tool:
        outcomes = diagnosed(tool, [task(trial, trial.name, folders) for trial in trials], folders, "diagnosing")
        first = {outcome.trial: outcome for outcome in outcomes}
        followed = [trial for trial in trials if _open(trial, first[trial.name])]
        followed = followed[: max(CASES - len(followed_before), 0)]
        second = follow_up(tool, followed, first, folders, jobs)
        compared = exhaustive.compare(tool, trials, first, folders, compared_before)
    seconds = time.perf_counter() - start
    others = _peers(trials, folders, jobs) if peers else {}
    answers = {trial.name: seal.open_seal(trial.name, folders.sealed, manifest) for trial in trials}
    marks = tuple(_marked(first[trial.name], answers[trial.name]) for trial in trials)
    advised = tuple(_advised(one, first[one.name], second, answers[one.name].names) for one in followed)
    advice_trials = sum(trial.group == "advice" for trial in trials)
    return {
        "wingfit": Table(marks, advised, advice_trials, seconds, compared),
        **{name: _table_of_peer(found, answers) for name, found in others.items()},
    }


def _peers(trials: Sequence[Trial], folders: Folders, jobs: int) -> dict[str, list[PeerOutcome]]:
    """Results of the comparison methods on the same datasets, by method, in the order of ``trials``."""
    from benchmarks.concealed.peers import run as run_peers  # needs the extra [peers]

    folders.peers.mkdir(exist_ok=True)
    tasks = [task(trial, trial.name, folders) for trial in trials]
    stored = {one.trial: found for one in tasks if (found := _stored_peers(one, folders)) is not None}

    def keep(found: tuple[PeerOutcome, ...]) -> None:
        stored[found[0].trial] = found
        path = folders.peers / f"{found[0].trial}.json"
        path.with_suffix(".part").write_text(json.dumps([asdict(one) for one in found]), encoding="utf-8")
        path.with_suffix(".part").replace(path)

    with pool(jobs) as executor:
        each(executor, run_peers, [one for one in tasks if one.trial not in stored], "peers", keep)
    return {outcomes[0].peer: list(outcomes) for outcomes in zip(*(stored[one.trial] for one in tasks), strict=True)}


def _stored_peers(request: Task, folders: Folders) -> tuple[PeerOutcome, ...] | None:
    """Results of the comparison methods from an earlier run on the same dataset; None if there are none."""
    from benchmarks.concealed.peers import PeerOutcome as Outcome

    path = folders.peers / f"{request.trial}.json"
    if not path.exists() or path.stat().st_mtime < request.dataset.stat().st_mtime:
        return None
    stored = json.loads(path.read_text(encoding="utf-8"))
    return tuple(Outcome(**(one | {"named": tuple(one["named"])})) for one in stored)


def _table_of_peer(outcomes: Sequence[PeerOutcome], answers: Mapping[str, Answer]) -> Table:
    from benchmarks.concealed.peers import mark as mark_of_peer

    marks = tuple(mark_of_peer(outcome, answers[outcome.trial]) for outcome in outcomes)
    return Table(marks, (), 0, sum(outcome.seconds for outcome in outcomes))


def _open(trial: Trial, outcome: Outcome) -> bool:
    """Whether the diagnosis is ambiguous in a trial that hides a single effect."""
    known = trial.group in ("listed", "measurement", "advice")
    return known and outcome.finding is not None and outcome.finding.verdict == "ambiguous"


def follow_up(
    tool: Executor, trials: Sequence[Trial], first: dict[str, Outcome], folders: Folders, jobs: int
) -> dict[str, Outcome]:
    """Record each rig once more, under the advised and under a random condition, and diagnose again.

    ``first``: outcomes of the first diagnoses by trial. Returns the new outcomes by label, ``TRIAL-advised`` and
    ``TRIAL-random``; none where the dataset refuses the new recording.
    """
    wanted = [
        (trial, label, condition)
        for trial in trials
        for label, condition in (
            (f"{trial.name}-advised", _advice(first[trial.name])),
            (f"{trial.name}-random", _by_chance(trial, folders)),
        )
        if condition is not None
    ]
    with pool(jobs) as executor:
        orders = [
            record_trial.Addition(trial, condition, folders.dataset(trial.name), folders.dataset(label), folders.sealed)
            for trial, label, condition in wanted
        ]
        made = each(executor, record_trial.add, orders, "recording the advised conditions")
    longer = [task(trial, label, folders) for (trial, label, _), kept in zip(wanted, made, strict=True) if kept]
    again = diagnosed(tool, longer, folders, "diagnosing again")
    return {outcome.trial: outcome for outcome in again}


def _by_chance(trial: Trial, folders: Folders) -> Condition:
    """A random condition of the rig that the dataset does not have."""
    known = {one.name for one in load_dataset(folders.dataset(trial.name)).recordings}
    return any_condition(trial, known, np.random.default_rng([trial.seed, 9]))


def _advice(outcome: Outcome) -> Condition | None:
    """The first condition that a finding recommends; None if it recommends none."""
    if outcome.finding is None or not outcome.finding.advice:
        return None
    best = outcome.finding.advice[0].condition
    if best is None:
        return None
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
        return finding is not None and finding.verdict in NAMING and set(finding.named) == truth

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
        return replace(failed(answer, outcome.reason), seconds=outcome.seconds)
    return replace(mark(outcome.finding, answer), seconds=outcome.seconds)
