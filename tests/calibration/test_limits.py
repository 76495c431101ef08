"""Settings of a calibration beyond their limits, and names that are repeated, are refused without a server, too."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from wingfit.calibration.search import CalibrationSpec, prepare
from wingfit.records import Dataset, Genome

SPEC = CalibrationSpec(division="4", population=16, max_generations=4, seed=7)


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"population": 0}, "population is 0; it should be greater than or equal to 4"),
        ({"population": 2000}, "population is 2000; it should be less than or equal to 1000"),
        ({"population": 8.0}, "population is 8.0; it should be a whole number"),
        ({"max_generations": 0}, "max_generations is 0; it should be greater than or equal to 1"),
        ({"stall": 0}, "stall is 0; it should be greater than or equal to 1"),
        ({"tolerance": -5.0}, "tolerance is -5.0; it should be greater than or equal to 0"),
        ({"tolerance": float("nan")}, "tolerance is nan; it should be greater than or equal to 0"),
        ({"seed": -1}, "seed is -1; it should be greater than or equal to 0"),
        ({"bounds_factor": 1.0}, "bounds_factor is 1.0; it should be greater than or equal to 1.01"),
        ({"method": "auto", "finish": True}, "finish means nothing for the method auto"),
        ({"genes": ("E_f", "E_f")}, "gene 'E_f' is named 2 times; name it once"),
        ({"recordings": ("a", "a")}, "recording 'a' is named 2 times; name it once"),
    ],
)
def test_numbers_beyond_their_limits_and_repeated_names_are_refused(
    changes: dict[str, Any], match: str, small: tuple[Dataset, Genome]
) -> None:
    """As they are over HTTP."""
    with pytest.raises(ValueError, match=match):
        prepare(replace(SPEC, **changes), small[0])
