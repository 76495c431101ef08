"""Which verdicts change when a threshold of the diagnosis is halved or doubled.

``python -m benchmarks.policy --json`` diagnoses a fixed sample of concealed trials with each threshold of
:class:`wingfit.diagnosis.policy.Policy` at half and at twice its value, and ends with one JSON object. A trial counts
as changed where the verdict or the effects that it names differ from those with the policy as it is.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import statistics
import sys
import tempfile
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.concealed.run_diagnosis import Outcome, Task, run
from benchmarks.concealed.running import Folders, each, pool, task
from benchmarks.concealed.seal import read
from benchmarks.concealed.suite import make
from benchmarks.concealed.trials import Trial, plan
from wingfit.diagnosis.policy import POLICY, Policy, described

SEED = 8  # of the concealed suite
FACTORS = {"halved": 0.5, "doubled": 2.0}
PROBABILITIES = ("single", "listed", "possible", "predicted_weight")
"""Fractions, whose odds are halved and doubled: a probability of 1.7 means nothing."""
FAINT = 0.35  # of the concealed strength: so weak that verdicts are close to the thresholds
FAINT_NAME = "-faint"
BLIND = replace(POLICY, negligible=1e3)
"""No residual is large enough for this policy: what it changes shows that a policy reaches the diagnosis."""
RIGHT = {"null": "adequate", "unlisted": "unnamed", "smooth": "unnamed", "drift": "unnamed"}


class Said(NamedTuple):
    """What a diagnosis concluded: the verdict, and the effects that it names."""

    verdict: str
    named: tuple[str, ...]

    @classmethod
    def of(cls, outcome: Outcome) -> Said:
        """The conclusion of ``outcome``; its verdict is "failed" if there is no finding."""
        found = outcome.finding
        return cls("failed", ()) if found is None else cls(found.verdict, tuple(sorted(found.named)))

    def __str__(self) -> str:
        return f"{self.verdict} ({', '.join(self.named)})" if self.named else self.verdict


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.policy", description=__doc__)
    parser.add_argument("--json", action="store_true", help="end with one line that holds everything as JSON")
    parser.add_argument("--jobs", type=int, default=2, help="processes at once")
    parser.add_argument("--wings", type=int, default=1, help="wings in the sample, the fastest first")
    parser.add_argument(
        "--keep",
        type=Path,
        help="keep datasets and conclusions in this folder, and use those that it holds; new code needs a new folder",
    )
    parser.add_argument("--only", action="append", default=[], help="only this threshold; may be repeated")
    arguments = parser.parse_args()
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as scratch:
        folders = Folders(arguments.keep or Path(scratch))
        trials = sample(arguments.wings)
        make(trials, folders, arguments.jobs)
        table = changes(trials, folders, arguments.jobs, arguments.only)
    _print(table)
    if arguments.json:
        print(json.dumps({**table, "seed": SEED, "seconds": round(time.perf_counter() - start)}))


def sample(wings: int) -> list[Trial]:
    """Sample: vehicle trials of the quick blind test, copies of them with weaker effects, and ``wings`` wing trials.

    Wings with the coarsest models are taken first.
    """
    trials = plan(SEED, quick=True)
    vehicles = [one for one in trials if not one.build.division]
    faint = [replace(one, name=f"{one.name}{FAINT_NAME}", target=FAINT * one.target) for one in vehicles if one.hidden]
    coarse = sorted((one for one in trials if one.build.division), key=lambda one: len(one.build.division))
    return [*vehicles, *faint, *coarse[:wings]]


def varied(name: str, factor: float) -> float:
    """Value of the threshold ``name`` times ``factor``; for a probability p, p / (1 - p) is multiplied instead."""
    value = float(getattr(POLICY, name))
    if name not in PROBABILITIES:
        return value * factor
    odds = factor * value / (1.0 - value)
    return odds / (1.0 + odds)


def changes(trials: list[Trial], folders: Folders, jobs: int, only: list[str]) -> dict[str, Any]:
    """Diagnose ``trials`` with each threshold halved and doubled; returns the conclusions that change, by threshold.

    ``only``: names of the thresholds to vary, all if empty.
    """
    thresholds = [one for one in described() if not only or one["name"] in only]
    if unknown := set(only) - {one["name"] for one in described()}:
        raise SystemExit(f"unknown threshold {', '.join(sorted(unknown))}; `--only` takes names of Policy's fields")
    tasks = [task(trial, trial.name, folders) for trial in trials]
    cases = [(one["name"], how) for one in thresholds for how in FACTORS]
    every: list[Task] = [*tasks, *(replace(one, policy=BLIND) for one in tasks)]
    for name, how in cases:
        policy = replace(POLICY, **{name: varied(name, FACTORS[how])})
        every += [replace(one, policy=policy) for one in tasks]
    said = conclusions(every, folders.root / "conclusions", jobs)
    before, rows = said[: len(tasks)], {one["name"]: dict(one) for one in thresholds}
    if said[len(tasks) : 2 * len(tasks)] == before:
        raise SystemExit("no conclusion changes where no residual is large enough: the policy is not used")
    for k, (name, how) in enumerate(cases):
        after = said[(k + 2) * len(tasks) : (k + 3) * len(tasks)]
        rows[name][how] = {
            trial.name: f"{old} -> {new}" for trial, old, new in zip(trials, before, after, strict=True) if old != new
        }
    right = [
        _right(one, folders, found)
        for one, found in zip(trials, before, strict=True)
        if not one.name.endswith(FAINT_NAME)
    ]
    idle = [name for name, row in rows.items() if not any(row[how] for how in FACTORS)]
    return {
        "trials": {one.name: f"{one.group}: {said}" for one, said in zip(trials, before, strict=True)},
        "right_percent": round(100 * statistics.mean(right)),
        "thresholds": list(rows.values()),
        "change_nothing": idle,
    }


def conclusions(tasks: list[Task], folder: Path, jobs: int) -> list[Said]:
    """Run each task and return its conclusion; they are cached in ``folder``, so that an interrupted run can resume."""
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{one.trial}-{_digest(one.policy)}.json" for one in tasks]
    missing = [pair for pair in zip(tasks, files, strict=True) if not pair[1].exists()]
    with pool(jobs) as executor:
        each(executor, _conclude, missing, "diagnosing")
    return [Said(verdict, tuple(named)) for verdict, named in (json.loads(file.read_text()) for file in files)]


def _conclude(job: tuple[Task, Path]) -> None:
    one, file = job
    part = file.with_suffix(".part")
    part.write_text(json.dumps(Said.of(run(one))), encoding="utf-8")
    part.rename(file)


def _digest(policy: Policy) -> str:
    return hashlib.sha256(json.dumps(asdict(policy)).encode()).hexdigest()[:16]


def _right(trial: Trial, folders: Folders, said: Said) -> bool:
    """Whether the conclusion ``said`` is right for what is hidden in ``trial``."""
    hidden = read(folders.answer(trial.name)).names
    wanted = RIGHT.get(trial.group)
    return said.verdict == wanted if wanted else set(said.named) == set(hidden)


def _print(table: dict[str, Any]) -> None:
    print(
        f"{len(table['trials'])} trials, {table['right_percent']} % of the strong ones right with the policy as it is",
        file=sys.stderr,
    )
    for row in table["thresholds"]:
        parts = [f"{how}: {len(row[how])} changed" for how in FACTORS]
        print(f"{row['name']:18} {row['value']:6g}  {', '.join(parts)}")
        for how in FACTORS:
            for trial, change in row[how].items():
                print(f"{'':26}{how} {trial}: {change}")


if __name__ == "__main__":
    main()
