"""Diagnose real recordings and compare the verdicts with what others document.

``python -m benchmarks.real [--json] [--only NAME ...] [--data DIR] [--fetch DIR]``; with ``--json`` the last line is
one JSON object. ``--only`` takes beginnings of names. The recordings are not part of the project: they are read from
``--data``, or ``../shared/data``; ``--fetch`` downloads them.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from benchmarks.common.machine import commit, cpu
from benchmarks.real import balls, flutter, pendulum, yeo
from benchmarks.real.fetch import fetch
from benchmarks.real.trial import SIBLING, Trial, data_folder, run

TRIALS: tuple[Trial, ...] = (*balls.TRIALS, *pendulum.TRIALS, *flutter.TRIALS, *yeo.TRIALS)


def main() -> None:
    """Run the trials and print a table, or JSON."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.real", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")
    parser.add_argument("--only", nargs="*", default=[], help="beginnings of the names of the trials to run")
    parser.add_argument("--data", help="folder of the recordings")
    parser.add_argument("--fetch", metavar="DIR", help="download the recordings to DIR and end")
    options = parser.parse_args()
    if options.fetch:
        sys.exit(0 if fetch(Path(options.fetch), print) else 1)
    folder = data_folder(options.data)
    if folder is None:
        print(f"skipped: no folder {options.data or SIBLING}; give --data, or --fetch DIR")
        return
    chosen = [one for one in TRIALS if not options.only or any(one.name.startswith(name) for name in options.only)]
    if not chosen:
        sys.exit(f"no trial begins with {' or '.join(options.only)}; there are {', '.join(one.name for one in TRIALS)}")
    rows, controls, absent = list[dict[str, Any]](), list[dict[str, Any]](), list[str]()
    for trial in chosen:
        try:
            row = run(trial, folder, lambda line: print(line, file=sys.stderr, flush=True))
        except FileNotFoundError as error:
            print(f"{trial.name} skipped: {error.filename} is absent; --fetch DIR downloads it", flush=True)
            absent.append(trial.name)
            continue
        (controls if trial.control else rows).append(row)
        print(_line(row), flush=True)
    if options.json:
        about = {"commit": commit(), "cpu": cpu()}
        print(json.dumps({"rigs": rows, **_counts(rows), "controls": controls, "skipped": absent, **about}))


def _line(row: dict[str, Any]) -> str:
    names = ", ".join(row["names"]) or "-"
    return (
        f"{row['name']:40} {row['verdict']:18} {names:40} p {row['probability']} held out {row['heldout_before']} -> "
        f"{row['heldout_after']} (floor {row['floor']}) right: {row['right']} in {row['seconds']} s"
    )


def _counts(rows: list[dict[str, Any]]) -> dict[str, int]:
    return {
        "right": sum(one["right"] is True for one in rows),
        "abstained": sum(one["right"] == "abstained" for one in rows),
        "wrong": sum(one["right"] is False for one in rows),
    }


if __name__ == "__main__":
    main()
