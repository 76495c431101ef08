"""All measurements of plans, by two processes."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from multiprocessing import get_context
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


def measured(campaigns: int, draws: int) -> dict[str, Any]:
    """Return all results, as plain data; two processes simulate."""
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        of_wings = pool.submit(_wings, campaigns)
        of_effects = pool.submit(_cases, draws)
        of_vehicles = pool.submit(_vehicles, campaigns)
        of_plans = pool.submit(_plans)
        compared = of_vehicles.result() + of_wings.result()
        drawn, second = of_effects.result()
        plans = of_plans.result()
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


def _wings(campaigns: int) -> list[Compared]:
    with closing(make_evaluator("in_process")) as evaluator:
        return wings(campaigns, evaluator, show)


def _vehicles(campaigns: int) -> list[Compared]:
    with closing(make_evaluator("in_process")) as evaluator:
        return vehicles(campaigns, evaluator, show)


def _cases(draws: int) -> tuple[list[Case], list[Case]]:
    """Return draws without and, a third as many, with a second effect that neither hypothesis contains."""
    with closing(make_evaluator("in_process")) as evaluator:
        drawn = cases(draws, evaluator, on_case=lambda k: show(f"draw {k}"))
        few = max(draws // 3, 1)
        return drawn, cases(few, evaluator, 12, resonance=True, on_case=lambda k: show(f"second effect, draw {k}"))


def _plans() -> dict[str, float]:
    """Return the processor seconds of plans of the examples, with all effects."""
    with closing(make_evaluator("in_process")) as evaluator:
        return {name: _seconds_of_plan(name, evaluator) for name in ("robird", "delfly")}


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
