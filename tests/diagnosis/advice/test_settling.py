"""The probability that a recording settles which hypothesis is right: its limits, and what increases it."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from tests.diagnosis.verdict.refits import data, refit
from wingfit.diagnosis.advice.settling import Settling
from wingfit.diagnosis.verdict.weigh_hypotheses import HypothesisWeights

SHARE, SAMPLES = 1.0 / 7.0, 6.0


def settling(first: float = 0.5, unknown: float = 0.0) -> Settling:
    """Between two hypotheses that leave as much, of which the first has the probability ``first``."""
    refits = (refit(2.0, drift=4.0), refit(0.5, ("a",), drift=0.2), refit(0.5, ("b",), drift=0.6))
    parts = (1.0 - unknown) * np.array([0.0, first, 1.0 - first])
    weights = HypothesisWeights(refits, np.array([0.0, 9.0, 9.0]), parts, unknown, np.array([4.0, 0.25, 0.25]))
    return Settling(data(), weights, (1, 2), 0.0)


def probability(found: Settling, separation: float, samples: float = 1e4, longer: float = 1.0) -> float:
    """Of a recording in which the two differ by ``separation``, with so many independent samples."""
    apart = separation**2 * (1.0 - np.eye(2))
    return found.probability(found.elsewhere(apart, samples * apart), SHARE, SAMPLES, longer)


def test_equal_predictions_settle_nothing_and_different_ones_settle_it() -> None:
    found = settling()
    values = [probability(found, size) for size in (0.0, 0.3, 0.6, 1.0, 2.0, 5.0)]
    assert values[0] == 0.0
    assert values == sorted(values)
    assert values[-1] == pytest.approx(1.0)
    assert 0.0 < values[2] < 1.0


def test_what_is_outside_the_library_is_not_settled() -> None:
    assert probability(settling(unknown=0.2), 5.0) == pytest.approx(0.8)


def test_noise_makes_it_less_sure() -> None:
    found = settling()
    assert probability(found, 1.0, samples=3.0) < probability(found, 1.0)


def test_a_rival_that_nothing_separates_stays() -> None:
    """Of three, two of which always predict the same, only the third can be named."""
    refits = (refit(2.0), *(refit(0.5, (name,)) for name in "abc"))
    excess = np.array([4.0, 0.25, 0.25, 0.25])
    weights = HypothesisWeights(refits, np.full(4, 9.0), np.array([0.0, 0.4, 0.3, 0.3]), 0.0, excess)
    found = Settling(data(), weights, (1, 2, 3), 0.0)
    apart = 25.0 * np.array([[0.0, 1.0, 1.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert found.probability(found.elsewhere(apart, 1e4 * apart), SHARE, SAMPLES) == pytest.approx(0.4)


def test_a_repetition_repeats_the_error_of_the_model() -> None:
    """The excess of each hypothesis is that of the recording that is repeated, and only noise is new."""
    found = settling()
    cast("Any", found.data).excess_by_recording = lambda coefficients: np.full(6, coefficients)
    apart = 0.5 * (1.0 - np.eye(2))
    expected = found.again(2, apart, 1e6 * apart)
    np.testing.assert_allclose(expected.excess, [[4.0, 0.2, 0.6]] * 2)
    np.testing.assert_array_equal(expected.by_model, 0.0)
    half = expected.with_part(found.elsewhere(apart, 1e6 * apart), 0.5)
    np.testing.assert_allclose(half.excess[0], [4.0, 0.225, 0.5 * 0.6 + 0.5 * 0.75])


def test_the_same_question_has_the_same_answer() -> None:
    assert probability(settling(0.7), 0.6) == probability(settling(0.7), 0.6)
