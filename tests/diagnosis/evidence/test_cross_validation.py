"""Cross-validation where a gene is at its bound: the others do not move with it as if it were free."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from wingfit.diagnosis.evidence.refit import cross_validated_excess
from wingfit.diagnosis.evidence.whitening import Whitening
from wingfit.diagnosis.policy import POLICY


def test_genes_beside_one_at_its_bound_stay_where_they_fit_best() -> None:
    """Two experiments agree that the first gene is at its bound, and where the second is then: nothing moves."""
    slopes = np.array([[1.0, -0.9], [0.0, 0.5], [0.2, 0.1]])
    outward = np.linalg.lstsq(slopes.T, np.array([-5.0, 0.0]), rcond=None)[0]  # no gradient of the second gene
    data: Any = SimpleNamespace(
        experiments=((0,), (1,)),
        recordings=(SimpleNamespace(name="a"), SimpleNamespace(name="b")),
        recording_slices=(slice(0, 3), slice(3, 6)),
        whitening=Whitening(np.ones(6)),
        whiten=lambda coefficients: coefficients,
        whitened_slopes=lambda jacobian: jacobian,
        weight=np.full(6, 0.5),
        variance=np.ones(6),
        policy=POLICY,
        likelihood_weight=lambda _: 100.0,
    )
    fit: Any = SimpleNamespace(
        coefficients=np.tile(outward, 2),
        jacobian=np.tile(slopes, (2, 1)),
        unit=np.array([1.0, 0.5]),
        problem=SimpleNamespace(free=("first", "second")),
    )
    fitted = float(data.weight @ (fit.coefficients**2 - data.variance))
    assert cross_validated_excess(data, fit) == pytest.approx(fitted)
