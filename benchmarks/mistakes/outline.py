"""Describes the wings of a vehicle with another length or chord than they have, diagnoses it, and counts what is named.

``python -m benchmarks.mistakes.outline --json`` prints one JSON object as its last line. The datasets are of vehicles,
from the plants of the concealed trials, without hidden physics.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import wingfit
from benchmarks.mistakes.good import Good, vehicles
from wingfit.records import Dataset, Vehicle

SEED, DATASETS = 37, 20
NEAR = 0.1  # of the true factor, of one that is found
FACTORS = {"wing_length_error": (0.9, 0.95, 1.05), "wing_chord_error": (0.5, 0.9, 1.3)}


def main() -> None:
    """Run the benchmark as the command line requests."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mistakes.outline", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")
    parser.add_argument("--seed", type=int, default=SEED, help="of the datasets")
    parser.add_argument("--datasets", type=int, default=DATASETS, help="number of datasets")
    arguments = parser.parse_args()
    answer = run(print, arguments.seed, arguments.datasets)
    if arguments.json:
        print(json.dumps(answer))


def run(say: Callable[[str], None], seed: int = SEED, datasets: int = DATASETS) -> dict[str, Any]:
    """Diagnose ``datasets`` datasets with wrong outlines, and return the counts; ``say`` gets progress.

    Only those count that hide nothing and are *adequate* with the right outline.
    """
    start, rows, good = time.perf_counter(), {name: _row() for name in FACTORS}, 0
    for k, one in enumerate(vehicles(datasets, seed)):
        if not one.hidden and wingfit.diagnose(one.dataset).verdict == "adequate":
            good += 1
            for name, factors in FACTORS.items():
                for factor in factors:
                    _count(rows[name], one, name, factor)
        spent = time.perf_counter() - start
        say(f"{k + 1} of {datasets} datasets, {spent * (datasets - k - 1) / (k + 1):.0f} s left: {rows}")
    return {"outlines": rows, "datasets": good, "seconds": round(time.perf_counter() - start, 1)}


def _row() -> dict[str, int]:
    return dict.fromkeys(("n", "named", "near", "ambiguous", "unnamed", "adequate", "wrong"), 0)


def _count(row: dict[str, int], one: Good, name: str, factor: float) -> None:
    """Diagnose ``one`` with lengths or chords described ``factor`` times as large, and count what the finding names.

    "ambiguous": the truth is among the possible causes; "wrong": a name without the truth.
    """
    rig = _described(one.dataset.vehicle, name, factor)
    found = wingfit.diagnose(Dataset(one.name, rig, one.dataset.recordings, one.dataset.held_out))
    row["n"] += 1
    row["named"] += found.verdict in ("named", "partly named") and found.named == (name,)
    row["near"] += found.named == (name,) and _near(found.genes, name, 1.0 / factor)
    row["ambiguous"] += found.verdict == "ambiguous" and name in found.named
    row["unnamed"] += found.verdict == "unnamed"
    row["adequate"] += found.verdict == "adequate"
    row["wrong"] += bool(found.named) and name not in found.named


def _described(vehicle: Vehicle, name: str, factor: float) -> Vehicle:
    stretch: Mapping[str, float] = {"r" if name == "wing_length_error" else "chord": factor}
    stations = (
        replace(one, **{side: value * getattr(one, side) for side, value in stretch.items()})
        for one in vehicle.stations
    )
    return replace(vehicle, stations=tuple(stations))


def _near(genes: Any, name: str, wanted: float) -> bool:
    (part,) = (one.value.value for one in genes if one.name == f"{name}.part")
    return bool(abs(1.0 + part - wanted) <= NEAR * wanted)


if __name__ == "__main__":
    main()
