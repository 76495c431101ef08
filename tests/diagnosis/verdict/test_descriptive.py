"""An effect that only describes how recordings differ, beside a mechanism like it."""

from __future__ import annotations

import pytest

from tests.diagnosis.verdict.refits import data, refit
from wingfit.diagnosis.evidence.refit import Refit
from wingfit.diagnosis.verdict.verdict import decide
from wingfit.diagnosis.verdict.weigh_hypotheses import weigh


def verdict(nominal: float, *others: Refit) -> str:
    return decide(weigh(data(), refit(nominal), others, 0.0, 40)).verdict


@pytest.mark.parametrize(("left", "expected"), [(0.6, "ambiguous"), (1.5, "named")])
def test_a_description_is_named_only_where_no_mechanism_like_it_leaves_nearly_as_little(
    left: float, expected: str
) -> None:
    """Leaving 0.6 of 5 noises, 1.4 % of the excess, may be due to the form of the mechanism's law; 9 % is not."""
    described, mechanism = refit(0.2, ("varying",), confused_with=("stall",)), refit(left, ("stall",))
    assert verdict(5.0, described, mechanism) == expected
    assert verdict(5.0, described, refit(left, ("another",))) == "named"
    assert verdict(5.0, refit(0.2, ("varying",)), mechanism) == "named"


def test_effects_with_more_genes_or_like_a_partner_alone_are_no_rivals_of_a_description() -> None:
    described, several = refit(0.2, ("varying",), confused_with=("stall",)), refit(1.0, ("stall", "x", "y"), genes=6)
    assert verdict(5.0, described, several) == "named"
    beside = Refit((*refit(0.0, ("x",)).trials, *described.trials), described.fit, 0.04, 0.04)
    assert verdict(5.0, beside, refit(0.6, ("like x",))) == "named"
