"""All case studies in one command: ``python -m benchmarks.proof`` (or ``make proof``), under 15 minutes on 2 cores.

The data come from "the plant", a simulator that shares no code with wingfit's own and contains hidden physics. The
files are diagnosed, and each study ends with a report. Claims about the result are checked; the exit status is 1 if any
claim does not hold.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.common.machine import commit, cpu
from benchmarks.proof import continuous, delfly, robird
from benchmarks.proof.story import Story, opened
from wingfit.cli.base.output import note, say

FOLDER = Path("build") / "proof"
WORKERS = 2
TITLES = {
    "robird": "(a) The Robird: a displaced axis and a linkage of another shape are hidden",
    "delfly": "(b) The DelFly: clap-and-peel is hidden from a model after Berman and Wang",
    "continuous": "(c) A continuous wing with markers measured by hand: a displaced axis is hidden",
}


def main(words: list[str] | None = None) -> int:
    """Run the studies with the command-line arguments ``words``; returns 0 if every claim holds, else 1."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.proof", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")
    parser.add_argument("--only", choices=tuple(TITLES), help="run only this study")
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder for datasets and reports")
    parser.add_argument("--seed", type=int, default=1, help="seed of parameters, cameras, balance and noise")
    parser.add_argument("--workers", type=int, default=WORKERS, help="number of worker processes")
    parser.add_argument("--search-s", type=float, default=robird.SEARCH_S, help="time limit of the thesis's search, s")
    parser.add_argument("--no-browser", action="store_true", help="do not open the reports in a browser")
    options = parser.parse_args(words)
    options.out.mkdir(parents=True, exist_ok=True)
    plays: dict[str, Callable[[], Story]] = {
        "robird": lambda: robird.play(options.out, options.seed, options.workers, options.search_s),
        "delfly": lambda: delfly.play(options.out, options.seed, options.workers),
        "continuous": lambda: continuous.play(options.out, options.seed, options.workers),
    }
    began, stories = time.monotonic(), {}
    for name in TITLES if options.only is None else (options.only,):
        say(TITLES[name])
        start = time.monotonic()
        stories[name] = plays[name]()
        show(stories[name], time.monotonic() - start, browser=not options.no_browser)
    if options.json:
        figures = {name: story.as_json() for name, story in stories.items()}
        print(json.dumps({**figures, "seconds": time.monotonic() - began, "cpu": cpu(), "commit": commit()}))
    return 0 if all(claim.holds for story in stories.values() for claim in story.claims) else 1


def show(story: Story, seconds: float, *, browser: bool) -> None:
    """Print a study, its claims, the path of its report and its duration; with ``browser``, open the report."""
    for line in story.lines:
        say(line)
    for claim in story.claims:
        say(f"{'yes' if claim.holds else 'NO '}  {claim.words}")
    say(f"report: {story.report} ({seconds:.0f} s in all)")
    if browser and not opened(story.report):
        note("no browser is available; open the report yourself")
    say("")


if __name__ == "__main__":
    sys.exit(main())
