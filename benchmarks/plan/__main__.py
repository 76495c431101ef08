"""``python -m benchmarks.plan [--json] [--campaigns N] [--draws N]``: what plans predict against simulated campaigns.

Standard errors are compared with the scatter of the estimates of N campaigns (default 100) of a wing and of a vehicle,
in several designs, once with stated noise and once with that of a single recorded campaign. Effects are drawn at random
sizes; what the plan predicts is compared with likelihood ratios of nonlinear fits to simulated recordings.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from contextlib import closing
from typing import Any

import numpy as np

from benchmarks.common.files import EXAMPLES
from benchmarks.common.machine import commit, cpu
from benchmarks.common.progress import show
from benchmarks.plan.detection import Case, cases
from benchmarks.plan.scatter import Compared, ratios, vehicles, wings
from wingfit.calibration.evaluator import Evaluator
from wingfit.planning import PlanSpec, plan_dataset
from wingfit.planning.description import load_planned
from wingfit.records import wing_or_vehicle
from wingfit.workers import make_evaluator


def main() -> None:
    """Measure, and print a table or JSON."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.plan", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")
    parser.add_argument("--campaigns", type=int, default=100, help="simulated campaigns of each design")
    parser.add_argument("--draws", type=int, default=60, help="drawn effects, and drawn pairs of effects")
    options = parser.parse_args()
    with closing(make_evaluator("in_process")) as evaluator:
        found = measured(options.campaigns, options.draws, evaluator)
    if not options.json:
        for name, value in found.items():
            print(f"{name:40} {value}")
        return
    print(json.dumps(found))


def measured(campaigns: int, draws: int, evaluator: Evaluator) -> dict[str, Any]:
    """Return all results, as plain data."""
    plans = {name: _seconds_of_plan(name, evaluator) for name in ("robird", "delfly")}
    compared = vehicles(campaigns, evaluator, show) + wings(campaigns, evaluator, show)
    drawn = cases(draws, evaluator, on_case=lambda k: show(f"draw {k}"))
    second = cases(
        max(draws // 3, 1), evaluator, 12, resonance=True, on_case=lambda k: show(f"second effect, draw {k}")
    )
    return {
        **_ratios("standard_error_ratio", compared),
        **{
            f"{rig}_{noise}": _ratios("ratio", [one for one in compared if (one.rig, one.noise) == (rig, noise)])
            for rig in ("wing", "vehicle")
            for noise in ("stated", "seen")
        },
        "campaigns": campaigns,
        "distinguishable_right_percent": _right(drawn),
        **{f"{what}_right_percent": _right([one for one in drawn if one.what == what]) for what in _WHATS},
        "predicted_percent": 100.0 * float(np.mean([one.predicted for one in drawn])),
        "shown_percent": 100.0 * float(np.mean([one.shown for one in drawn])),
        "sure_right_percent": _right([one for one in drawn if not 0.1 < one.predicted < 0.9]),
        "with_a_second_effect_right_percent": _right(second),
        "draws": len(drawn),
        "minutes": max(plans.values()) / 60.0,
        "cpu_seconds_of_plans": plans,
        "commit": commit(),
        "cpu": cpu(),
    }


_WHATS = ("detected", "distinguished")


def _ratios(name: str, compared: Sequence[Compared]) -> dict[str, Any]:
    """Return median, and the range that holds 90 per cent, of the ratios of predicted errors and scatter."""
    low, middle, high = np.percentile(ratios(compared), [5.0, 50.0, 95.0])
    return {f"{name}_median": float(middle), f"{name}_90": [float(low), float(high)]}


def _right(drawn: Sequence[Case]) -> float:
    return 100.0 * float(np.mean([one.right for one in drawn]))


def _seconds_of_plan(name: str, evaluator: Evaluator) -> float:
    """Return the processor seconds of a plan of an example with all effects."""
    dataset = wing_or_vehicle(load_planned(EXAMPLES / name))
    show(f"planning {name}")
    began = time.process_time()
    plan_dataset(dataset, PlanSpec(), evaluator)
    return time.process_time() - began


if __name__ == "__main__":
    main()
