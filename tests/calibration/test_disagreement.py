"""Local estimates of a coefficient that differ by more than their errors."""

from __future__ import annotations

import numpy as np
import pytest

from wingfit.calibration.forces.disagreement import disagreement_remarks, disagreements
from wingfit.calibration.forces.result import LocalEstimate

ERROR = 0.02


def estimates(values: list[float], error: float = ERROR) -> list[LocalEstimate]:
    return [
        LocalEstimate(f"run {k}", (f"run {k}",), {"C_l": value}, {"C_l": error}, ((1.0,),), (), 0.0, True, ())
        for k, value in enumerate(values)
    ]


def test_estimates_that_span_a_factor_of_two_disagree() -> None:
    values = [0.8, 1.0, 1.1, 1.25, 1.4, 1.6]
    found = disagreements(estimates(values))
    assert found == {"C_l": pytest.approx(np.std(values, ddof=1))}
    (remark,) = disagreement_remarks(estimates(values))
    assert "the 6 local estimates of C_l disagree: 0.8 to 1.6" in remark


def test_equal_coefficients_disagree_as_rarely_as_stated() -> None:
    random = np.random.default_rng(7)
    found = [disagreements(estimates(list(1.0 + ERROR * random.standard_normal(6)))) for _ in range(2000)]
    assert 0.004 < np.mean([bool(one) for one in found]) < 0.018  # 0.01, and 3.6 standard errors of it


def test_estimates_without_errors_are_not_compared() -> None:
    assert disagreements(estimates([1.0, 2.0], np.inf)) == {}
    assert disagreements(estimates([1.0])) == {}
