"""What the report says of the place of a misfit, and of how it scales."""

from __future__ import annotations

import pytest

from wingfit.diagnosis.finding import Exponent, Interval
from wingfit.report.location import _scaling


def power(variable: str, low: float, high: float) -> Exponent:
    return Exponent(variable, Interval((low + high) / 2, low, high), 1.0, 2.0, "")


@pytest.mark.parametrize(
    ("powers", "said"),
    [
        ([("flap frequency", 1.8, 2.2)], "The misfit scales with flap frequency^2"),
        (
            [("flap frequency", -0.2, 0.5), ("air density", -0.01, 0.01)],
            "does not depend on flap frequency or air density",
        ),
        ([("flap frequency", -1.2, 1.5)], "not identifiable"),
        ([("flap frequency", -1.2, 1.5), ("air density", -0.1, 0.1)], "does not depend on air density"),
        ([("flap frequency", 1.8, 2.2), ("air density", -0.1, 0.1)], "scales with flap frequency^2"),
    ],
)
def test_no_dependence_is_told_from_none_that_is_known(powers: list[tuple[str, float, float]], said: str) -> None:
    assert said in _scaling(tuple(power(*one) for one in powers), "the misfit")
