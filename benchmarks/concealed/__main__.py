"""Concealed trials of the diagnosis.

``python -m benchmarks.concealed --json`` runs the whole suite and ends with one JSON object. ``--make DIR --n K`` only
leaves datasets for development behind, from other seeds than any suite's; answers lie beside them, for whoever looks.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

from benchmarks.concealed.answer import GROUPS
from benchmarks.concealed.suite import Folders, conduct, make
from benchmarks.concealed.table import side_by_side
from benchmarks.concealed.trials import plan

DEVELOPMENT = 500_000
"""Seeds from here on are for development; a suite's are smaller."""


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.concealed", description=__doc__)
    parser.add_argument("--json", action="store_true", help="end with one line that holds everything as JSON")
    parser.add_argument("--quick", action="store_true", help="a sample of the trials, in at most 8 minutes")
    parser.add_argument("--only", action="append", choices=GROUPS, default=[], help="only this group of trials")
    parser.add_argument("--jobs", type=int, default=2, help="processes at once")
    parser.add_argument("--seed", type=int, default=8, help=f"below {DEVELOPMENT}; the same seed, the same table")
    parser.add_argument(
        "--keep",
        type=Path,
        help="keep datasets, answers and findings in this folder, and go on with those that it holds",
    )
    parser.add_argument("--peers", action="store_true", help="also the peers of the extra [peers]")
    parser.add_argument("--make", type=Path, help="only leave datasets for development in this folder")
    parser.add_argument("--n", type=int, default=10, help="how many of those")
    arguments = parser.parse_args()
    if not 0 <= arguments.seed < DEVELOPMENT:
        parser.error(f"--seed is {arguments.seed}; it must lie in [0, {DEVELOPMENT})")
    if arguments.make:
        trials = plan(DEVELOPMENT + arguments.seed, only=arguments.only)[: arguments.n]
        make(trials, Folders(arguments.make), arguments.jobs)
        return
    trials = plan(arguments.seed, quick=arguments.quick, only=arguments.only)
    with tempfile.TemporaryDirectory() as scratch:
        tables = conduct(trials, arguments.keep or Path(scratch), arguments.jobs, peers=arguments.peers)
    print(side_by_side(tables))
    if arguments.json:
        own, *others = ({"method": name, **table.as_json()} for name, table in tables.items())
        print(json.dumps({**own, "peers": [{**one, "failures": len(one["failures"])} for one in others]}))


if __name__ == "__main__":
    main()
