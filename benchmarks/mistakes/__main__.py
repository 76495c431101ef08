"""Applies deliberate mistakes to good datasets, and counts those that the checks catch, explain and correct.

``python -m benchmarks.mistakes --json`` prints one JSON object as its last line. A kind of mistake counts as caught if
it is caught in every dataset that it was tried on; likewise for the right cause and for the correction. A good dataset
with any finding is a false alarm.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.mistakes import vehicles as of_vehicles
from benchmarks.mistakes import wings as of_wings
from benchmarks.mistakes.good import Good, vehicles, wings
from benchmarks.mistakes.kinds import Kind
from wingfit.checks import Mistake, check_dataset, examine
from wingfit.checks.repair import repaired
from wingfit.records import Dataset, DatasetError
from wingfit.records.files.folder import contents

KINDS = (*of_wings.KINDS, *of_vehicles.KINDS)
WINGS, VEHICLES = 34, 26  # good datasets
SEED = 11
TRIED = 2  # datasets on which each kind is tried


def main() -> None:
    """Run the benchmark as the command line requests."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mistakes", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")
    parser.add_argument("--seed", type=int, default=SEED, help="of the good datasets")
    parser.add_argument("--tried", type=int, default=TRIED, help="datasets on which each kind is tried")
    parser.add_argument("--only", help="only kinds whose name contains this")
    arguments = parser.parse_args()
    answer = run(print, arguments.seed, arguments.tried, arguments.only)
    if arguments.json:
        print(json.dumps(answer))


def run(
    say: Callable[[str], None],
    seed: int = SEED,
    tried: int = TRIED,
    only: str | None = None,
    good: tuple[int, int] = (WINGS, VEHICLES),
) -> dict[str, Any]:
    """Try each kind of mistake on ``tried`` datasets, and return the counts of the JSON object.

    ``say``: called with each line of the table; ``seed``: of the good datasets; ``only``: only kinds whose name
    contains it; ``good``: numbers of good datasets of wings and of vehicles.
    """
    start = time.perf_counter()
    examples = {"wing": list(wings(good[0], seed)), "vehicle": list(vehicles(good[1], seed))}
    alarms = list(_alarms(one for each in examples.values() for one in each))
    chosen = [kind for kind in KINDS if not only or only in kind.name]
    rows = {f"{kind.rig}: {kind.name}": _tried(kind, examples[kind.rig], tried) for kind in chosen}
    for name, row in rows.items():
        say(f"{name:50} caught {row['caught']} of {row['n']}, cause {row['right_cause']}, fixed {row['fixed_right']}")
    whole = {key: sum(row[key] == row["n"] > 0 for row in rows.values()) for key in ("caught", "right_cause")}
    fixed = sum(row["fixed_right"] == row["n"] > 0 for row in rows.values())
    answer = {
        "mistakes": {"n": len(rows), **whole, "fixed_right": fixed, "by_kind": rows},
        "false_alarms": len(alarms),
        "good": sum(map(len, examples.values())),
        "seconds": round(time.perf_counter() - start, 1),
    }
    say("; ".join(f"{key}: {value}" for key, value in answer.items() if key != "mistakes"))
    say(
        f"{whole['caught']} of {len(rows)} kinds caught, {whole['right_cause']} with the right cause, {fixed} corrected"
    )
    return answer


def _alarms(good: Iterable[Good]) -> Iterable[str]:
    for one in good:
        found = examine(one.dataset)
        if found:
            print(f"false alarm: {one.name} ({one.hidden}): {found[0]}", file=sys.stderr)
            yield one.name


def _tried(kind: Kind, good: Sequence[Good], count: int) -> dict[str, int]:
    """Apply ``kind`` to the first datasets to which it applies, starting at another one for each kind."""
    row = {"n": 0, "caught": 0, "right_cause": 0, "fixed_right": 0}
    first = sum(map(ord, kind.name)) % len(good)
    for offset in range(len(good)):
        one = good[(first + offset) % len(good)]
        wrong = kind.make(one.dataset, np.random.default_rng(first + offset))
        if wrong is None or row["n"] == count:
            continue
        row["n"] += 1
        with tempfile.TemporaryDirectory() as scratch:
            outcome = _outcome(kind, wrong, one, Path(scratch))
        for key, value in zip(("caught", "right_cause", "fixed_right"), outcome, strict=True):
            row[key] += value
        if not all(outcome[: 2 + kind.fixable]):
            print(f"{kind.name} on {one.name} ({one.hidden}): {outcome}", file=sys.stderr)
    return row


def _outcome(kind: Kind, wrong: Dataset, good: Good, scratch: Path) -> tuple[bool, bool, bool]:
    """Whether the mistake is caught, its cause is named, and a corrected copy holds the good dataset's numbers."""
    try:
        folder = _written(wrong, scratch / "wrong")
        mistakes = check_dataset(folder).mistakes
    except DatasetError as error:
        return True, any(cause in error.message for cause in kind.causes), False
    right = any(one.kind in kind.causes for one in mistakes)
    return bool(mistakes), right, right and _corrected(folder, scratch / "fixed", mistakes, good.dataset)


def _written(dataset: Dataset, folder: Path) -> Path:
    """Write ``dataset`` as a careless user does: without the checks of :func:`wingfit.save_dataset`."""
    for name, data in contents(dataset, plausible=False).items():
        place = folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(data)
    return folder


def _corrected(folder: Path, target: Path, mistakes: Sequence[Mistake], good: Dataset) -> bool:
    try:
        repaired(folder, target, mistakes)
        fixed, left = check_dataset(target)
    except (DatasetError, ValueError):
        return False
    if left or not isinstance(fixed, Dataset):
        return False
    pairs = zip(fixed.recordings, good.recordings, strict=True)
    return all(
        _alike(a.values, b.values) and _alike(a.condition.flap_frequency, b.condition.flap_frequency) for a, b in pairs
    )


def _alike(found: object, wanted: object) -> bool:
    """Whether numbers agree within a thousandth; a gap where a number was made up is no difference."""
    a, b = np.asarray(found, float), np.asarray(wanted, float)
    both = np.isfinite(a) & np.isfinite(b)
    size = float(np.abs(b[np.isfinite(b)]).max())
    return bool(both.mean() > 0.7 and np.abs(a[both] - b[both]).max() < 2e-3 * size)


if __name__ == "__main__":
    main()
