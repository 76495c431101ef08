"""Time of a wing beat in other engines: ``python -m benchmarks.peers --division 24 --medium vacuum --json``."""

from __future__ import annotations

import argparse
import json
import os

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")  # before numpy is imported


def main() -> None:
    """Parse the command line, and print the cost and the error of a beat with each requested engine."""
    from benchmarks.peers import compare

    parser = argparse.ArgumentParser(prog="python -m benchmarks.peers", description=__doc__)
    parser.add_argument("--division", default="24", help="discretisation: a preset such as 24, or 6x4, or 3,3,3,2")
    parser.add_argument("--medium", choices=list(compare.CONDITIONS), default="vacuum")
    parser.add_argument(
        "--engine",
        choices=list(compare.CASES),
        action="append",
        help="engine, may be repeated (default: scipy and exudyn)",
    )
    parser.add_argument("--tolerance-mm", type=float, default=0.1, help="largest error of a marker")
    parser.add_argument("--seconds", type=float, default=600.0, help="time limit of each engine, s")
    parser.add_argument("--json", action="store_true", help="print one line of JSON")
    given = parser.parse_args()
    engines = given.engine or ["scipy", "exudyn"]
    rows = [compare.case(e, given.division, given.medium, given.tolerance_mm, given.seconds) for e in engines]
    if given.json:
        print(json.dumps(rows))
        return
    for row in rows:
        cost = row["cpu_ms_per_beat"]
        found = row["note"] if cost is None else f"{cost:.1f} ms of CPU a beat at {row['error_mm']:.3f} mm"
        print(f"{row['engine']}, {row['bodies']} bodies, {row['medium']}: {found} ({row['method']}, {row['settings']})")


if __name__ == "__main__":
    main()
