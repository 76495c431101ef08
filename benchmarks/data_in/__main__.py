"""Proves what reads and judges the data of a user: ``python -m benchmarks.data_in [--json] [--only-formats]``.

Four parts, of which ``--parts`` chooses some. ``formats``: files of other programs, intact and damaged
(benchmarks/data_in/formats.py). ``mistakes``: deliberate mistakes in datasets, and good datasets
(benchmarks/mistakes). ``alignment``: tracks in any camera axes (benchmarks/alignment). ``minutes``: how long a new user
needs from a file to a dataset, by a stated model of a person (benchmarks/data_in/minutes.py). Together they
take 25 minutes.

The last line is one JSON object with the keys of all parts that ran. The exit status is 1 if a file is read wrongly, is
guessed or crashes an importer, if a good dataset has a finding, if an alignment is falsely sure, or if a way from a
file to a dataset takes more than 10 minutes.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.data_in import formats

Say = Callable[[str], None]


def of_formats(options: argparse.Namespace, say: Say) -> tuple[dict[str, Any], bool]:
    """Return the measurements of the formats, and whether all went well."""
    result, notes = formats.run(options.seeds, options.mutations, options.only)
    for note in notes:
        print(note, file=sys.stderr)
    for row in result["formats"]:
        guesses = f"{row['silent_guesses']} silent guesses in {row['must_refuse']}"
        say(f"{row['format']:<14}{row['files']:>4} files, error {row['max_error_mm']:.1e} mm, {guesses}")
    return result, not notes


def of_mistakes(options: argparse.Namespace, say: Say) -> tuple[dict[str, Any], bool]:
    """Return how many mistakes are caught, and whether there is no false alarm."""
    from benchmarks.mistakes import __main__ as mistakes  # simulators, which do not belong to the importers' memory

    good = (options.good or mistakes.WINGS, options.good or mistakes.VEHICLES)
    result = mistakes.run(say, tried=options.tried or mistakes.TRIED, only=options.kind, good=good)
    return result, result["false_alarms"] == 0


def of_alignment(options: argparse.Namespace, say: Say) -> tuple[dict[str, Any], bool]:
    """Return how well tracks are aligned, and whether no alignment is falsely sure."""
    from benchmarks.alignment import __main__ as alignment

    result = alignment.run(say, options.trials or alignment.TRIALS)
    return result, result["alignment"]["falsely_sure"] == 0


def of_minutes(options: argparse.Namespace, say: Say) -> tuple[dict[str, Any], bool]:
    """Return the minutes from a file to a dataset, and whether they are few enough."""
    from benchmarks.data_in import minutes  # starts servers and a browser

    return minutes.run(say, options.data or minutes.DATA)


PARTS = {"formats": of_formats, "mistakes": of_mistakes, "alignment": of_alignment, "minutes": of_minutes}


def main() -> None:
    """Measure, print what went wrong, tables, and one JSON object; exit with 1 if anything is wrong."""
    options = _options()
    say: Say = (lambda _: None) if options.json else print
    whole, seconds, fine = dict[str, Any](), dict[str, float](), True
    for part in options.parts:
        began = time.monotonic()
        result, well = PARTS[part](options, say)
        whole, fine = {**whole, **result}, fine and well
        seconds[part] = round(time.monotonic() - began, 1)
    print(json.dumps({**whole, "seconds": seconds}))
    sys.exit(0 if fine else 1)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.data_in", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true", help="print the JSON object only")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS), help="leave out the other parts")
    parser.add_argument("--only-formats", dest="parts", action="store_const", const=["formats"], help="--parts formats")
    parser.add_argument("--seeds", type=int, default=formats.SEEDS, help="sets of files of every format")
    parser.add_argument("--mutations", type=int, default=formats.MUTATIONS, help="files that are changed at random")
    parser.add_argument("--only", metavar="FORMAT", help="only files of this format")
    parser.add_argument("--tried", type=int, help="datasets on which each mistake is tried")
    parser.add_argument("--kind", help="only mistakes whose name contains this")
    parser.add_argument("--good", type=int, help="good datasets of wings, and as many of vehicles")
    parser.add_argument("--trials", type=int, help="recordings that are aligned")
    parser.add_argument("--data", type=Path, help="folder with hawk/ and mocap/; without it, minutes are not measured")
    options = parser.parse_args()
    if options.only:
        options.parts = [part for part in options.parts if part == "formats"]
    return options


if __name__ == "__main__":
    main()
