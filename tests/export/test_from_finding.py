"""Which model of a finding is exported: what the verdict names, or what the user chooses."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.report.findings import force_finding, with_verdict
from wingfit.diagnosis.evidence.fitted_model import FittedModel
from wingfit.diagnosis.finding import Finding
from wingfit.export.from_finding import ChoiceError, chosen, label

FITTED = (
    FittedModel(("b", "a"), ("b", "a"), {"C_l": 1.0}, ("C_l",)),
    FittedModel((), (), {"C_l": 2.0}, ("C_l",)),
    FittedModel(("a",), ("a",), {"C_l": 3.0}, ("C_l",)),
)


def finding(verdict: str) -> Finding:
    return replace(with_verdict(force_finding(), verdict), fitted=FITTED)  # type: ignore[arg-type]


@pytest.mark.parametrize("verdict", ["named", "partly named", "measurement fault"])
def test_a_verdict_that_names_effects_gives_the_model_with_them(verdict: str) -> None:
    assert chosen(finding(verdict), None) is FITTED[0]


@pytest.mark.parametrize("verdict", ["ambiguous", "unnamed"])
def test_an_open_verdict_needs_a_choice(verdict: str) -> None:
    with pytest.raises(ChoiceError, match=r"choose one \(--hypothesis, .* of a\+b \(.*, nominal \(.*, a \("):
        chosen(finding(verdict), None)
    assert chosen(finding(verdict), "nominal") is FITTED[1]


@pytest.mark.parametrize(("text", "place"), [("a+b", 0), ("b + a", 0), ("a", 2), ("nominal", 1)])
def test_a_hypothesis_is_chosen_by_its_effects(text: str, place: int) -> None:
    assert chosen(finding("named"), text) is FITTED[place]
    assert label(FITTED[place]) in ("a+b", "a", "nominal")


def test_an_unknown_hypothesis_is_refused_with_those_that_exist() -> None:
    with pytest.raises(ChoiceError, match=r"no refitted hypothesis 'c'; there are a\+b"):
        chosen(finding("named"), "c")


def test_a_finding_without_effects_is_its_nominal_model() -> None:
    assert chosen(replace(finding("adequate"), fitted=FITTED[1:2]), None) is FITTED[1]


def test_a_finding_of_before_is_refused() -> None:
    with pytest.raises(ChoiceError, match="diagnose again"):
        chosen(replace(finding("named"), fitted=()), None)
