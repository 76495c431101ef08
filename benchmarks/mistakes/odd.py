"""Puts a mistake into one recording of a dataset, diagnoses it, and counts the findings that say which recording it is.

``python -m benchmarks.mistakes.odd --json`` prints one JSON object as its last line. The datasets are of vehicles, from
the plants of the concealed trials; those that hide physics stay without a mistake: a recording that is called odd in
them is a false alarm.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

import wingfit
from benchmarks.mistakes.command import command
from benchmarks.mistakes.good import Good, vehicles
from wingfit.records import Condition, Dataset, Recording

SEED, DATASETS = 29, 30
LEAST = 4  # recordings that are fitted, three of them beside the odd one
NEAR = 0.1  # relative error of a condition that is found
SAID = re.compile(r"Without (\S+) the model fits")
FOUND = {
    "airspeed": (r"airspeed of ([0-9.e+-]+) m/s", 1.0),
    "angle_of_attack": (r"angle of attack of ([0-9.e+-]+) deg", 180.0 / math.pi),
    "pressure": (r"air pressure of ([0-9.e+-]+) mbar", 0.01),
}

Change = Callable[[Recording], Recording]


def _with(one: Recording, **condition: float) -> Recording:
    return replace(one, condition=replace(one.condition, **condition))


MISTAKES: Mapping[str, Change] = {
    "airspeed": lambda one: _with(one, airspeed=1.5 * one.condition.airspeed),
    "angle_of_attack": lambda one: _with(one, angle_of_attack=one.condition.angle_of_attack + math.radians(10.0)),
    "pressure": lambda one: _with(one, pressure=0.7 * one.condition.pressure),
    "scale of one axis": lambda one: replace(one, values=one.values * [1.3, 1.0]),
    "start of the beat": lambda one: replace(one, times=one.times + 0.06 / one.condition.flap_frequency),
}


def main() -> None:
    """Run the benchmark as the command line requests."""
    command("odd", __doc__, run, SEED, DATASETS)


def run(say: Callable[[str], None], seed: int = SEED, datasets: int = DATASETS) -> dict[str, Any]:
    """Diagnose ``datasets`` datasets with and without mistakes, and return the counts; ``say`` gets progress."""
    start, rows = time.perf_counter(), {name: _row() for name in MISTAKES}
    good = {"n": 0, "odd": 0, "withheld": 0}
    for k, one in enumerate(vehicles(datasets, seed)):
        fitted = [r.name for r in one.dataset.recordings if r.name not in one.dataset.held_out]
        if len(fitted) < LEAST:
            continue
        plain = wingfit.diagnose(one.dataset)
        good["n"], good["odd"] = good["n"] + 1, good["odd"] + bool(SAID.findall(plain.summary))
        good["withheld"] += "No effect is named until then" in plain.summary
        if not one.hidden and plain.verdict == "adequate":
            for number, (name, change) in enumerate(MISTAKES.items()):
                where = fitted[np.random.default_rng([seed, k, number]).integers(len(fitted))]
                _count(rows[name], name, one, where, change)
        spent = time.perf_counter() - start
        say(
            f"{k + 1} of {datasets} datasets, {spent * (datasets - k - 1) / (k + 1):.0f} s left: {_total(rows)}, {good}"
        )
    return {"mistakes": rows, "total": _total(rows), "good": good, "seconds": round(time.perf_counter() - start, 1)}


def _row() -> dict[str, int]:
    return dict.fromkeys(("n", "adequate", "right", "wrong", "condition", "named"), 0)


def _count(row: dict[str, int], name: str, one: Good, where: str, change: Change) -> None:
    """Diagnose ``one`` with the mistake in the recording ``where``, and count what the finding says of it."""
    recordings = tuple(change(r) if r.name == where else r for r in one.dataset.recordings)
    found = wingfit.diagnose(Dataset(one.name, one.dataset.rig, recordings, one.dataset.held_out))
    said, truth = SAID.findall(found.summary), one.dataset.recording(where).condition
    row["n"] += 1
    row["adequate"] += found.verdict == "adequate"
    row["right"] += said == [where]
    row["wrong"] += bool(said) and where not in said
    row["condition"] += said == [where] and name in FOUND and _near(name, found.summary, truth)
    row["named"] += bool(found.named)


def _near(name: str, summary: str, truth: Condition) -> bool:
    pattern, factor = FOUND[name]
    stated, wanted = re.search(pattern, summary), factor * float(getattr(truth, name))
    return stated is not None and abs(float(stated[1]) - wanted) <= NEAR * abs(wanted)


def _total(rows: Mapping[str, Mapping[str, int]]) -> dict[str, int]:
    return {key: sum(row[key] for row in rows.values()) for key in _row()}


if __name__ == "__main__":
    main()
