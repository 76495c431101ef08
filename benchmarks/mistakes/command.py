"""The command line of a benchmark that puts mistakes into datasets of vehicles."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from typing import Any

Run = Callable[[Callable[[str], None], int, int], dict[str, Any]]


def command(name: str, description: str | None, run: Run, seed: int, datasets: int) -> None:
    """Run ``run`` (say, seed, datasets) as the command line requests; ``seed`` and ``datasets`` are the defaults."""
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks.mistakes.{name}", description=description)
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")
    parser.add_argument("--seed", type=int, default=seed, help="of the datasets")
    parser.add_argument("--datasets", type=int, default=datasets, help="number of datasets")
    arguments = parser.parse_args()
    answer = run(print, arguments.seed, arguments.datasets)
    if arguments.json:
        print(json.dumps(answer))
