"""The user's estimates of genes: taken within their bounds, else refused with the place to change."""

from __future__ import annotations

from dataclasses import replace

import pytest

from wingfit.records import EstimateError
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.vehicle.terms import chosen
from wingfit.sim.virtual_rigs.balance import delfly


def model(estimates: dict[str, float], preset: str = "proposed") -> BladeElementWing:
    return BladeElementWing(replace(delfly(), estimates=estimates), terms=chosen(preset))


@pytest.mark.parametrize(
    ("estimates", "said"),
    [
        ({"C_l": 900.0}, r"estimate of gene 'C_l' is 900; it must lie in \[0, 5\]"),
        ({"A": 9.0}, r"estimate of gene 'A' is 9 rad; it must lie in"),
        ({"C_l": 1.0, "C_x": 1.0}, "estimate for unknown gene 'C_x'; vehicles have A, C_D0,"),
    ],
)
def test_what_is_wrong_with_an_estimate_and_where_to_change_it(estimates: dict[str, float], said: str) -> None:
    with pytest.raises(EstimateError, match=said + r".*: change vehicle\.estimates in dataset\.yaml"):
        _ = model(estimates).genes


def test_an_estimate_for_a_term_that_is_off_must_be_good_as_well() -> None:
    assert "C_F" not in {gene.name for gene in model({"C_F": 1.0}, "berman_wang").genes}
    with pytest.raises(EstimateError, match="'C_F' is -1"):
        _ = model({"C_F": -1.0}, "berman_wang").genes
