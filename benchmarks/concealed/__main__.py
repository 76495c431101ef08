"""Blind test of the diagnosis: it must name physics hidden in datasets of an independent simulator, the plant.

``python -m benchmarks.concealed --json`` runs all trials (datasets); the last line is one JSON object.
``--make DIR --n K`` only writes K datasets for development into DIR, with their answers, from seeds that the test does
not use.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from benchmarks.concealed import results
from benchmarks.concealed.answer import GROUPS
from benchmarks.concealed.plant.vortex_lattice.simulate import VARIABLE
from benchmarks.concealed.running import Folders
from benchmarks.concealed.suite import conduct, make
from benchmarks.concealed.table import Table, side_by_side
from benchmarks.concealed.trials import plan

DEVELOPMENT = 500_000
"""Smallest seed of development datasets; those of the blind test are smaller."""


def main() -> None:
    """Run the blind test and print its table, or write development datasets, as the command line requests."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.concealed", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")
    parser.add_argument("--quick", action="store_true", help="run a sample of the trials; at most 8 minutes")
    parser.add_argument(
        "--only", action="append", choices=GROUPS, default=[], help="run only this group of trials; may be repeated"
    )
    parser.add_argument("--rig", choices=("wing", "vehicle"), help="run only the trials of this rig")
    parser.add_argument("--first", type=int, help="run only the first trials, so many; all are in random order")
    parser.add_argument("--jobs", type=int, default=2, help="number of processes")
    parser.add_argument("--seed", type=int, default=8, help=f"below {DEVELOPMENT}; the same seed gives the same table")
    parser.add_argument(
        "--keep",
        type=Path,
        help="store datasets, answers and findings in this folder, and resume from those already there",
    )
    parser.add_argument(
        "--results",
        type=Path,
        help="add the scores to this file, leave out the trials that it has, and report on all; for a run in parts",
    )
    parser.add_argument(
        "--stored",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="run nothing: report on the scores in these files of --results together, of any seeds",
    )
    parser.add_argument(
        "--peers", action="store_true", help="also run the two comparison methods; needs the extra [peers]"
    )
    parser.add_argument("--make", type=Path, help="only write datasets for development into this folder")
    parser.add_argument("--n", type=int, default=10, help="number of datasets that --make writes")
    arguments = parser.parse_args()
    if not 0 <= arguments.seed < DEVELOPMENT:
        parser.error(f"--seed is {arguments.seed}; it must lie in [0, {DEVELOPMENT})")
    if arguments.make:
        trials = plan(DEVELOPMENT + arguments.seed, only=arguments.only)[: arguments.n]
        make(trials, Folders(arguments.make), arguments.jobs)
        return
    if arguments.stored:
        _report({"wingfit": results.of_all_seeds(arguments.stored, arguments.rig, arguments.only)}, arguments.json)
        return
    lattice = bool(os.environ.get(VARIABLE))
    if not lattice:
        print(f"without the trials in a vortex lattice: {VARIABLE} is not set", file=sys.stderr)
    trials = plan(arguments.seed, quick=arguments.quick, only=arguments.only, lattice=lattice)
    trials = tuple(one for one in trials if arguments.rig in (None, one.build.rig))[: arguments.first]
    before = results.read(arguments.results, arguments.seed) if arguments.results else None
    if before:
        results.check_plan(before, trials)
    known = {mark.trial for mark in before.marks} if before else set[str]()
    new = tuple(trial for trial in trials if trial.name not in known)
    with tempfile.TemporaryDirectory() as scratch:
        tables = conduct(new, arguments.keep or Path(scratch), arguments.jobs, peers=arguments.peers, before=before)
    if arguments.results:
        results.append(arguments.results, arguments.seed, tables["wingfit"])
    if before:
        tables["wingfit"] = results.joined([before, tables["wingfit"]])
    _report(tables, arguments.json)


def _report(tables: Mapping[str, Table], as_json: bool) -> None:
    """Print the scores by method, wingfit first."""
    print(side_by_side(tables))
    if as_json:
        own, *others = ({"method": name, **table.as_json()} for name, table in tables.items())
        print(json.dumps({**own, "peers": [{**one, "failures": len(one["failures"])} for one in others]}))


if __name__ == "__main__":
    main()
