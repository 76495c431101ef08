"""Run the blind trials: record and seal all, diagnose each as a user would, open the seals, and count."""

from __future__ import annotations

import json
import pickle
import time
from collections.abc import Iterable
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.any_rig.rigs import RIGS
from benchmarks.any_rig.trials import Answer, Trial, recorded
from benchmarks.common.progress import show_count
from benchmarks.concealed.seal import digest
from wingfit import Finding, SeriesDataset, diagnose
from wingfit.diagnosis.finding import NAMING, Interval

Outcome = tuple["Mark", Answer]
VISIBLE = 1.6  # strength from which a hidden thing counts, as in benchmarks.concealed


@dataclass(frozen=True)
class Mark:
    """What a diagnosis reported: verdict, names, most probable effects, held-out misfits before and after, and seconds.

    ``intervals``: 90 % interval of each gene of the best model by name, where both its ends are known.
    """

    verdict: str
    names: tuple[str, ...]
    first: tuple[str, ...]
    probability: float
    before: float | None
    after: float | None
    seconds: float
    remarks: tuple[str, ...] = ()
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)


def record(trial: Trial, folder: Path) -> str:
    """Record ``trial`` into ``folder``: the dataset, and the answer, whose SHA-256 is returned."""
    dataset, answer = recorded(trial)
    (folder / f"{trial.name}.pickle").write_bytes(pickle.dumps(dataset))
    salt = np.random.default_rng([trial.seed, 7]).bytes(16).hex()
    text = json.dumps({"salt": salt, "answer": answer.as_json()}, sort_keys=True)
    (folder / f"{trial.name}.json").write_text(text, encoding="utf-8")
    return digest(text)


def run(trial: Trial, folder: Path) -> Mark:
    """Diagnose the dataset of ``trial`` in ``folder``; the answer is not read."""
    dataset: SeriesDataset = pickle.loads((folder / f"{trial.name}.pickle").read_bytes())  # noqa: S301 - ours
    began = time.monotonic()
    finding = diagnose(dataset, rig=RIGS[trial.rig])
    return mark(finding, time.monotonic() - began)


def mark(finding: Finding, seconds: float) -> Mark:
    """Return the mark of ``finding``."""
    first = max((h for h in finding.hypotheses if h.effects), key=lambda h: h.probability, default=None)
    proof = finding.proof
    return Mark(
        finding.verdict,
        finding.named,
        first.effects if first else (),
        finding.probabilities[finding.verdict],
        proof.before.value if proof else None,
        proof.after.value if proof else None,
        seconds,
        finding.remarks,
        {one.name: ends for one in finding.genes if (ends := _ends(one.value)) is not None},
    )


def _ends(interval: Interval) -> tuple[float, float] | None:
    return None if interval.low is None or interval.high is None else (interval.low, interval.high)


def conduct(trials: list[Trial], folder: Path, jobs: int) -> list[Outcome]:
    """Record, seal, diagnose and open all ``trials``; a trial whose mark is in ``folder`` is not diagnosed again."""
    folder.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    with ProcessPoolExecutor(jobs) as pool:
        missing = [one for one in trials if not (folder / f"{one.name}.json").exists()]
        records = [pool.submit(record, one, folder) for one in missing]
        for done, record_done in enumerate(as_completed(records), 1):
            record_done.result()
            show_count("recording", done, len(records), began)
        manifest = {one.name: digest((folder / f"{one.name}.json").read_text(encoding="utf-8")) for one in trials}
        print(f"sealed: sha256 {digest(json.dumps(manifest, sort_keys=True))}", flush=True)
        began, marks = time.monotonic(), dict[str, Mark]()
        waiting = dict[Future[Mark], Trial]()
        for one in trials:
            kept = folder / f"{one.name}.mark.json"
            if kept.exists():
                marks[one.name] = Mark(**json.loads(kept.read_text(encoding="utf-8")))
            else:
                waiting[pool.submit(run, one, folder)] = one
        for done, future in enumerate(as_completed(waiting), 1):
            one = waiting[future]
            marks[one.name] = future.result()
            (folder / f"{one.name}.mark.json").write_text(json.dumps(asdict(marks[one.name])), encoding="utf-8")
            show_count("diagnosing", done, len(waiting), began)
    return [(marks[one.name], _opened(one, folder, manifest[one.name])) for one in trials]


def _opened(trial: Trial, folder: Path, sealed: str) -> Answer:
    text = (folder / f"{trial.name}.json").read_text(encoding="utf-8")
    if digest(text) != sealed:
        raise ValueError(f"the answer of {trial.name} has changed since it was sealed; run it again")
    known = json.loads(text)["answer"]
    return Answer(
        Trial(**known["trial"]),
        known["parameters"],
        known["size"],
        known["noise"],
        known["strength"],
        known.get("sizes", {}),
    )


def percent(marks: Iterable[bool]) -> float | None:
    """Return the percentage that is true; None of nothing."""
    every = list(marks)
    return round(100.0 * sum(every) / len(every), 1) if every else None


def covered(mark: Mark, answer: Answer) -> list[bool]:
    """Return whether each 90 % interval holds the true size, if the right effect is named; as benchmarks.concealed.

    Intervals that are open at an end, and sizes that the model does not have, are not counted.
    """
    if mark.verdict not in NAMING or answer.trial.hidden not in mark.names:
        return []
    known = ((mark.intervals[name], size) for name, size in answer.sizes.items() if name in mark.intervals)
    return [low <= size <= high for (low, high), size in known]


def counted(outcomes: list[Outcome]) -> dict[str, object]:
    """Return the rates of ``outcomes`` as the benchmark prints them."""
    nulls = [m for m, a in outcomes if a.trial.group == "null"]
    seen = [(m, a) for m, a in outcomes if a.trial.group == "listed" and a.strength >= VISIBLE]
    others = [(m, a) for m, a in outcomes if a.trial.group == "unlisted" and a.strength >= VISIBLE]
    intervals = [one for m, a in outcomes for one in covered(m, a)]
    wrong = [m.verdict in NAMING and any(n != a.trial.hidden for n in m.names) for m, a in outcomes]
    return {
        "null": len(nulls),
        "null_false_alarms_percent": percent(m.verdict != "adequate" for m in nulls),
        "listed": len(seen),
        "top1_percent": percent(tuple(m.first) == (a.trial.hidden,) for m, a in seen),
        "exact_percent": percent(m.verdict in NAMING and tuple(m.names) == (a.trial.hidden,) for m, a in seen),
        "unlisted": len(others),
        "unnamed_percent": percent(m.verdict == "unnamed" for m, _ in others),
        "detected_percent": percent(m.verdict != "adequate" for m, _ in others),
        "wrong_percent": percent(wrong),
        "intervals": len(intervals),
        "coverage_percent": percent(intervals),
        "median_seconds": round(float(np.median([m.seconds for m, _ in outcomes])), 1),
    }
