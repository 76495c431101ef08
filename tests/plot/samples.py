"""Answers of a server, made by hand, with every number known."""

from __future__ import annotations

import math
from typing import Any

PHASE = [0.75, 0.0, 0.25, 0.5]  # a stroboscopic recording is not in the order of the phase


def tracks(gap: float = 2.0) -> Any:
    """Markers a (root) and b (tip); recorded heights are ``gap`` mm above the simulated ones, b unseen once."""

    def places(lift: float) -> list[list[list[float]]]:
        return [[[0.0, 50.0, lift], [10.0, 400.0, 100 * math.sin(2 * math.pi * t) + lift]] for t in PHASE]

    recorded: list[Any] = places(gap)
    recorded[0][1] = [None, None, None]
    return {
        "recording": "slow <1>",
        "phase": PHASE,
        "markers": ["a", "b"],
        "recorded_mm": recorded,
        "simulated_mm": places(0.0),
        "stride": 1,
    }


def forces() -> Any:
    """Forces over the beat; the model is 1 mN too small along x and right along z."""
    phase = [k / 8 for k in range(8)]
    x = [0.1 * math.sin(2 * math.pi * t) for t in phase]
    return {
        "recording": "test-1",
        "source": "local",
        "phase": phase,
        "recorded_n": {"x": x, "z": [0.05] * 8},
        "standard_deviation_n": {"x": [0.01] * 8},
        "modelled_n": {"x": [value - 0.001 for value in x], "z": [0.05] * 8},
    }


def item(sequence: int, stage: str, best: float, mean: float | None) -> Any:
    """One generation of a run on tracks; its best misfit in mm is 10 times the root of ``best``."""
    return {
        "sequence": sequence,
        "stage": stage,
        "best": best,
        "mean": mean,
        "best_mm": 10 * math.sqrt(best),
        "best_mn": None,
        "best_percent": None,
    }


HISTORY = [
    item(1, "structural", 4.0, 9.0),
    item(2, "structural", 1.0, 2.0),
    item(3, "aerodynamic", 0.25, 0.5),
    item(4, "aerodynamic, Gauss-Newton", 0.04, 0.04),
]


def gene(name: str, best: float, error: float | None, *, searched: bool = True, identifiable: bool = True) -> Any:
    """A gene of an answer of the server, with bounds 0.1 and 10 and nominal value 1."""
    return {
        "name": name,
        "unit": "Pa",
        "description": f"the {name}",
        "nominal": 1.0,
        "best": best,
        "lower": 0.1,
        "upper": 10.0,
        "searched": searched,
        "standard_error_percent": None if error is None else 100 * error / best,
        "standard_error": error,
        "identifiable": identifiable,
    }


def series() -> Any:
    """The result of a run on series with one curve, whose nominal genome cannot be simulated."""
    curve = {"recording": "swing", "channel": "angle", "unit": "rad", "held_out": True, "stride": 1}
    curve |= {"time_s": [0.0, 0.1, 0.3], "recorded": [1.0, 0.5, 0.0], "nominal": None, "best": [1.0, 0.25, 0.0]}
    return {"kind": "series", "curves": [curve], "genes": [gene("stiffness", 2.0, 0.1)]}
