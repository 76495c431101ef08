"""Series keep their digits, whatever their size."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from wingfit.service.outcomes.series import rounded


@pytest.mark.parametrize("size", [5e-324, 1e-305, 1e-300, 1e-160, 1e-5, 1.0, 1e5, 1e300])
def test_a_series_of_any_size_is_plain_json(size: float) -> None:
    """Loads in air of 1e-300 mbar were a NaN, and the answer a server error."""
    answer = rounded(np.array([size, -size / 3, 0.0]))
    json.dumps(answer, allow_nan=False)
    assert math.isclose(answer[0], size, rel_tol=1e-6) or size < 1e-290
    assert math.isclose(answer[1], -size / 3, rel_tol=1e-6) or size < 1e-290


def test_digits_beyond_the_noise_are_left_out() -> None:
    assert rounded(np.array([1.23456789, 0.00000001, -0.00000001])) == [1.234568, 0.0, 0.0]
    assert rounded(np.array([0.0, -0.0])) == [0.0, 0.0]
