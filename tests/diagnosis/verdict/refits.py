"""Refits and data of a diagnosis with given residuals, without simulations."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.policy import POLICY


def refit(
    left: float,
    names: tuple[str, ...] = (),
    genes: int = 1,
    family: str = "structure",
    predicted: float | None = None,
    drift: float = 1.0,
    confused_with: tuple[str, ...] | None = None,
) -> Refit:
    """A refit with a residual of ``left`` noises (RMS), cross-validated to the same unless ``predicted``.

    ``drift``: mean square of the slow change of the beat that it leaves; ``confused_with``: makes it descriptive.
    """
    others = {"confused_with": confused_with or (), "descriptive": confused_with is not None}
    trials = tuple(
        SimpleNamespace(
            suspect=SimpleNamespace(name=n, family=family, genes=(), size_genes=(), **others), freedom=genes
        )
        for n in names
    )
    fit = SimpleNamespace(coefficients=drift)
    return Refit(cast("Any", trials), cast("Any", fit), left**2, (left if predicted is None else predicted) ** 2)


def data(
    recordings: int = 6,
    excess_standard_error: float = 0.0,
    drift: float = 0.0,
    mean: float = 0.0,
    worst: float = 0.0,
    kind: str = "tracks",
    modulation: float = 0.0,
) -> WhitenedData:
    """Recordings with a noise of one, of which the first has an excess of ``worst`` noises (RMS)."""
    return cast(
        "WhitenedData",
        SimpleNamespace(
            noise=1.0,
            effective_samples=6.0 * recordings,
            excess_standard_error=excess_standard_error,
            excess_by_chance=lambda _: 0.0,
            accepted=0.0,
            gene_cost=POLICY.gene_cost,
            kind=kind,
            policy=POLICY,
            drift=drift,
            modulation=modulation,
            beat_fits=(),
            noise_of_recordings=np.ones(recordings),
            uncertainty_of_beats=np.zeros(recordings),
            recordings=[SimpleNamespace(name=f"r{k}") for k in range(recordings)],
            excess_by_recording=lambda _: np.array([worst**2, *[0.0] * (recordings - 1)]),
            tolerance=POLICY.tolerance,
            change_of_beat=float,
            mean_beat_excess=lambda _: mean,
        ),
    )
