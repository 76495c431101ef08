"""Blind trials of the diagnosis on small rigs of other fields, and times of the tool itself.

``--json`` prints one JSON object as its last line.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

from benchmarks.any_rig.suite import Outcome, conduct, counted
from benchmarks.any_rig.timings import first_finding_minutes, overhead_ms_per_call
from benchmarks.any_rig.trials import plan
from benchmarks.common.machine import commit, cpu

FULL, QUICK = (12, 12, 6), (1, 2, 1)


def main() -> None:
    """Run the trials and print a line for each, and the rates."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.any_rig", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")
    parser.add_argument("--quick", action="store_true", help="a sample: four trials for each rig")
    parser.add_argument("--rig", action="append", default=[], help="only this rig; may be repeated")
    parser.add_argument("--seed", type=int, default=1, help="the same seed gives the same trials")
    parser.add_argument("--jobs", type=int, default=2, help="number of processes")
    parser.add_argument("--keep", type=Path, help="keep datasets, answers and marks here, and resume from them")
    chosen = parser.parse_args()
    trials = [t for t in plan(chosen.seed, QUICK if chosen.quick else FULL) if not chosen.rig or t.rig in chosen.rig]
    with tempfile.TemporaryDirectory() as scratch:
        outcomes = conduct(trials, chosen.keep or Path(scratch), chosen.jobs)
    for outcome in outcomes:
        print(line(outcome))
    rates = counted(outcomes)
    rates |= {"overhead_ms_per_call": overhead_ms_per_call(), "first_finding_minutes": first_finding_minutes()}
    print("\n".join(f"{name}: {value}" for name, value in rates.items()))
    if chosen.json:
        print(json.dumps({**rates, "seed": chosen.seed, "commit": commit(), "cpu": cpu()}))


def line(outcome: Outcome) -> str:
    """Return one trial as text."""
    mark, answer = outcome
    trial = answer.trial
    said = f"{mark.verdict} {', '.join(mark.names)} ({mark.probability:.2f})"
    proof = "" if mark.before is None else f"held out {mark.before:.2f} -> {mark.after:.2f}"
    truth = f"{trial.rig}: {trial.hidden or 'nothing'} d {answer.strength:.1f}, noise {trial.noise}"
    return f"{trial.name} {truth} | {said} | first {' + '.join(mark.first)} | {proof} | {mark.seconds:.0f} s"


if __name__ == "__main__":
    main()
