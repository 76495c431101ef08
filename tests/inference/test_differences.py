"""Finite differences against closed forms, at bounds, beside failures, and in a single batch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pytest

from wingfit.inference.differences import STEP, Outputs, differences

Array = npt.NDArray[np.float64]

ALL = np.arange(3)


class Simulated:
    """Two outputs of three genes; individuals whose genes are in ``failing`` fail. Counts what it simulates."""

    def __init__(self, failing: Sequence[tuple[int, float]] = ()) -> None:
        self.failing, self.batches = failing, list[int]()

    def __call__(self, units: Array) -> tuple[Outputs, tuple[str | None, ...]]:
        self.batches.append(len(units))
        a, b, c = units.T
        first = np.stack([a**2, a * b, np.full_like(a, np.nan)], axis=1)
        second = np.stack([[np.sin(c), b], [3.0 * a, c]]).transpose(2, 0, 1)
        bad = [any(units[k, gene] > limit for gene, limit in self.failing) for k in range(len(units))]
        return [first, second], tuple("it flutters" if one else None for one in bad)


def test_derivatives_are_those_of_the_closed_form_in_one_batch() -> None:
    simulate, unit = Simulated(), np.array([0.3, 0.6, 0.5])
    found = differences(simulate, unit, ALL)
    assert simulate.batches == [found.evaluations] == [7]
    assert found.known.all()
    np.testing.assert_allclose(found.slopes[0][:2], [[0.6, 0.0, 0.0], [0.6, 0.3, 0.0]], atol=1e-12)
    assert np.all(found.slopes[0][2] == 0.0), "what is not observed has no slope"
    np.testing.assert_allclose(found.slopes[1][0, 0], [0.0, 0.0, np.cos(0.5)], rtol=STEP**2)


def test_one_side_needs_half_the_individuals_and_errs_with_the_step() -> None:
    simulate, unit = Simulated(), np.array([0.3, 0.6, 0.5])
    at = [part[0] for part in simulate(unit[None])[0]]
    found = differences(simulate, unit, ALL, at=at, sides=1)
    assert simulate.batches == [1, 3]
    assert found.slopes[0][0, 0] == pytest.approx(0.6 + STEP)


@pytest.mark.parametrize(("sides", "error"), [(1, -STEP), (2, -STEP)])
def test_a_step_that_would_leave_the_box_is_taken_inwards(sides: int, error: float) -> None:
    found = differences(Simulated(), np.array([1.0, 0.0, 0.5]), np.array([0]), sides=sides)
    assert found.slopes[0][0, 0] == pytest.approx(2.0 + error)


def test_a_neighbour_that_fails_leaves_a_one_sided_difference() -> None:
    found = differences(Simulated(failing=[(0, 0.3)]), np.array([0.3, 0.6, 0.5]), ALL)
    assert found.known.all()
    assert found.reasons == ("it flutters",)
    assert found.slopes[0][0, 0] == pytest.approx(0.6 - STEP)


def test_a_gene_without_neighbours_is_not_known_and_a_failing_point_is_refused() -> None:
    def only_there(units: Array) -> tuple[Outputs, tuple[str | None, ...]]:
        return [units[:, :1]], tuple(None if one[0] == 0.5 else "it flutters" for one in units)

    found = differences(only_there, np.array([0.5, 0.5]), np.arange(2))
    assert found.known.tolist() == [False, True]
    assert found.slopes[0].tolist() == [[0.0, 0.0]]
    with pytest.raises(ValueError, match="cannot be simulated: it flutters"):
        differences(only_there, np.array([0.4, 0.5]), np.arange(2))
