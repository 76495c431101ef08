"""The fitness of a run by generation, from the answer of the client; without plotly, as the curves."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

NEWTON = ", Gauss-Newton"
OF_RANGE = "% of range"


@dataclasses.dataclass(frozen=True)
class Fitness:
    """Fitness of N generations, in ``unit``: of the best individual and the mean of all; None where there is none.

    ``x`` [N] counts the generations over the run from 1. ``stages``: (first generation, name) of each stage in order.
    ``notes`` [N] have the best misfit as text, ``last`` the last of these that is known.
    """

    x: Sequence[int]
    best: Sequence[float | None]
    mean: Sequence[float | None]
    unit: str
    stages: Sequence[tuple[int, str]]
    notes: Sequence[str]
    last: str


def fitness_of(items: Sequence[Mapping[str, Any]]) -> Fitness:
    """Return the fitness by generation of ``items``, an answer of :meth:`wingfit.Client.history`.

    Raises:
        ValueError: there are no generations yet.
    """
    if not items:
        raise ValueError("the run has no generation yet; wait until it has: Client.wait(run_id)")
    unit = _unit(items)
    new = [k for k, item in enumerate(items) if k == 0 or items[k - 1]["stage"] != item["stage"]]
    misfits = [_misfit(item) for item in items]
    return Fitness(
        x=[item["sequence"] for item in items],
        best=[_value(item, "best", unit) for item in items],
        mean=[None if _alone(item) else _value(item, "mean", unit) for item in items],
        unit=unit,
        stages=[(items[k]["sequence"], items[k]["stage"]) for k in new],
        notes=[f", {text}" if text else "" for text in misfits],
        last=next((text for text in reversed(misfits) if text), "not known yet"),
    )


def _unit(items: Sequence[Mapping[str, Any]]) -> str:
    for key, unit in (("best_mm", "m²"), ("best_mn", "N²"), ("best_percent", OF_RANGE)):
        if any(item.get(key) is not None for item in items):
            return unit
    return "sum of squares"


def _misfit(item: Mapping[str, Any]) -> str:
    if item.get("best_mm") is not None:
        return f"{item['best_mm']:.2f} mm per marker"
    if item.get("best_mn") is not None:
        return f"{item['best_mn']:.3g} mN RMS"
    return "" if item.get("best_percent") is None else f"{item['best_percent']:.3g} {OF_RANGE}"


def _value(item: Mapping[str, Any], name: str, unit: str) -> float | None:
    """Return best or mean, positive, as a logarithmic axis needs it; the squares of series as percent of the range."""
    value = item[name]
    if value is None or not value > 0:
        return None
    if unit != OF_RANGE:
        return float(value)
    best, percent = item["best"], item.get("best_percent")
    return percent * math.sqrt(value / best) if best and percent is not None else None


def _alone(item: Mapping[str, Any]) -> bool:
    """Return whether the item is an iteration of Gauss-Newton: one individual, which has no mean."""
    return bool(item["stage"].endswith(NEWTON) or item["mean"] == item["best"])
