"""Describes the wings of a vehicle with another length or chord than they have, diagnoses it, and counts what is named.

``python -m benchmarks.mistakes.outline --json`` prints one JSON object as its last line. The datasets are of vehicles,
from the plants of the concealed trials, without hidden physics.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import wingfit
from benchmarks.mistakes.command import command
from benchmarks.mistakes.good import Good, vehicles
from wingfit.records import Dataset, Vehicle

SEED, DATASETS = 37, 20
NEAR = 0.1  # of the true factor, of one that is found
FACTORS = {"wing_length_error": (0.9, 0.95, 1.05), "wing_chord_error": (0.5, 0.9, 1.3)}


def main() -> None:
    """Run the benchmark as the command line requests."""
    command("outline", __doc__, run, SEED, DATASETS)


def run(say: Callable[[str], None], seed: int = SEED, datasets: int = DATASETS) -> dict[str, Any]:
    """Diagnose ``datasets`` datasets with wrong outlines, and return the counts; ``say`` gets progress.

    Only those count that hide nothing and are *adequate* with the right outline.
    """
    start, rows, good = time.perf_counter(), {name: Counter[str]() for name in FACTORS}, 0
    for k, one in enumerate(vehicles(datasets, seed)):
        if not one.hidden and wingfit.diagnose(one.dataset).verdict == "adequate":
            good += 1
            for name, factors in FACTORS.items():
                for factor in factors:
                    _count(rows[name], one, name, factor)
        spent = time.perf_counter() - start
        say(f"{k + 1} of {datasets} datasets, {spent * (datasets - k - 1) / (k + 1):.0f} s left: {rows}")
    return {"outlines": rows, "datasets": good, "seconds": round(time.perf_counter() - start, 1)}


def _count(row: Counter[str], one: Good, name: str, factor: float) -> None:
    """Diagnose ``one`` with lengths or chords described ``factor`` times as large, and count the outcome.

    That is the verdict, "wrong" if its names do not contain the truth, and "others too" if it names more than that.
    "near" counts those named whose factor is found.
    """
    rig = _described(one.dataset.vehicle, "r" if name == "wing_length_error" else "chord", factor)
    found = wingfit.diagnose(Dataset(one.name, rig, one.dataset.recordings, one.dataset.held_out))
    outcome: str = found.verdict
    if found.named and name not in found.named:
        outcome = "wrong"
    elif len(found.named) > 1 and outcome != "ambiguous":
        outcome = "others too"
    row.update(("n", outcome))
    row["near"] += found.named == (name,) and _near(found.genes, name, 1.0 / factor)


def _described(vehicle: Vehicle, side: str, factor: float) -> Vehicle:
    stations = (replace(one, **{side: factor * getattr(one, side)}) for one in vehicle.stations)
    return replace(vehicle, stations=tuple(stations))


def _near(genes: Any, name: str, wanted: float) -> bool:
    (part,) = (one.value.value for one in genes if one.name == f"{name}.part")
    return bool(abs(1.0 + part - wanted) <= NEAR * wanted)


if __name__ == "__main__":
    main()
