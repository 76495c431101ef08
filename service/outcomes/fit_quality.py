"""How a model fits its recordings: the residual as a multiple of the noise, and a badge for lists and heads of pages.

A badge looks at the fitted and at the held-out recordings, and takes the worse: a model that fits well and predicts
badly is not good.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from wingfit.calibration.result import ADEQUATE
from wingfit.client.answers import FitBadge
from wingfit.diagnosis.finding import Finding, RecordingMisfit

DOUBTFUL = 3.0  # times the noise: above it, most of the residual is not noise but missing physics or wrong input


@dataclass(frozen=True)
class FitQuality:
    """Misfit of a model on the fitted (``residual``) and the held-out recordings, as multiples of the noise.

    None: there is no such recording, or its noise is not known.
    """

    residual: float | None
    held_out: float | None


def of_result(kind: str, result: Mapping[str, Any]) -> FitQuality:
    """Return how the best genome of a calibration fits; ``result``: its JSON answer, for the ``kind`` of data."""
    if kind == "series":
        if result["relative_to"] != "noise":
            return FitQuality(None, None)
        return FitQuality(_positive(result["after"]), _positive(result["held_out_after"]))
    unit = {"tracks": "mm", "forces": "mn"}[kind]
    noise = result.get(f"noise_{unit}")
    return FitQuality(*(_ratio(result[f"{one}_{unit}"], noise) for one in ("after", "held_out_after")))


def of_finding(finding: Finding) -> FitQuality:
    """Return how the model of ``finding``, with the effects that were added, fits.

    The noise of a diagnosis is the floor: noise, and the known errors of the discretisation and of marker positions.
    """
    fitted, held_out = ([r for r in finding.recordings if r.held_out == which] for which in (False, True))
    return FitQuality(_over_floor(fitted), finding.proof.after.value if finding.proof else _over_floor(held_out))


def badge(residual: float | None, held_out: float | None) -> FitBadge | None:
    """Return the badge of a fit from its misfits as multiples of the noise; None if that of the fit is not known.

    ``good``: at most ADEQUATE, so that noise explains the residual; ``doubtful``: at most DOUBTFUL; else ``wrong``.
    """
    if residual is None:
        return None
    worst = max(residual, residual if held_out is None else held_out)
    if worst <= ADEQUATE:
        return "good"
    return "doubtful" if worst <= DOUBTFUL else "wrong"


def _over_floor(recordings: Sequence[RecordingMisfit]) -> float | None:
    """Return the root mean square, over ``recordings``, of the misfit divided by its floor; None without any."""
    ratios = [r.after.value / r.floor for r in recordings if r.floor > 0]
    return math.sqrt(math.fsum(one**2 for one in ratios) / len(ratios)) if ratios else None


def _ratio(value: float | None, noise: float | None) -> float | None:
    return value / noise if value is not None and noise else None


def _positive(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
