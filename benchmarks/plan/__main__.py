"""``python -m benchmarks.plan [--json] [--campaigns N] [--draws N]``: what plans predict against simulated campaigns.

Standard errors are compared with the scatter of the estimates of N campaigns (default 100) of a wing and of a vehicle,
in several designs, once with stated noise and once with that of a single recorded campaign. Effects are drawn at random
sizes; what the plan predicts is compared with likelihood ratios of nonlinear fits to simulated recordings.
"""

from __future__ import annotations

import argparse
import json

from benchmarks.plan.measured import measured


def main() -> None:
    """Measure, and print a table or JSON."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.plan", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")
    parser.add_argument("--campaigns", type=int, default=100, help="simulated campaigns of each design")
    parser.add_argument("--draws", type=int, default=60, help="drawn effects, and drawn pairs of effects")
    options = parser.parse_args()
    found = measured(options.campaigns, options.draws)
    if not options.json:
        for name, value in found.items():
            print(f"{name:40} {value}")
        return
    print(json.dumps(found))


if __name__ == "__main__":
    main()
