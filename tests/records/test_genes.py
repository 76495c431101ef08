"""What a gene says about a value that it does not admit."""

from __future__ import annotations

import re

import pytest

from wingfit.records import Gene


@pytest.mark.parametrize(
    ("unit", "said"),
    [
        ("Pa", "gene 'g' is 0 Pa; it must lie in [1, 3] Pa"),
        ("1", "gene 'g' is 0; it must lie in [1, 3]"),
    ],
)
def test_an_error_on_bounds_names_value_and_unit(unit: str, said: str) -> None:
    gene = Gene(name="g", unit=unit, nominal=2.0, lower=1.0, upper=3.0, scale="linear", description="")
    with pytest.raises(ValueError, match=f"^{re.escape(said)}$"):
        gene.check(0.0)


@pytest.mark.parametrize("bound", [float("inf"), float("nan")])
def test_bounds_must_be_finite(bound: float) -> None:
    with pytest.raises(ValueError, match=r"gene 'k': its bounds are .*; give finite ones"):
        Gene("k", "N/m", 1.0, 0.0, bound)
