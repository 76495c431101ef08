"""Which point is which marker: at one instant, and from one to the next."""

from __future__ import annotations

import numpy as np
import pytest

from tests.cameras.track.moving_wing import BEAT, DEVIATION, cloud_of, markers, moved
from wingfit.cameras.track.follow import Followed, follow
from wingfit.cameras.track.outliers import jumps
from wingfit.cameras.track.registration import assign, deformed, register, surface_of
from wingfit.records.array_types import Array, Mask

REST = markers()
ALL = np.ones(len(REST), dtype=bool)


@pytest.mark.parametrize("time", [0.0, 0.07, 0.19, 0.28])
def test_a_bent_wing_is_registered_among_false_points(time: float) -> None:
    rng = np.random.default_rng(int(1000 * time))
    seen = rng.random(49) > 0.1
    true = moved(REST, time, bend=0.4)
    cloud, index = cloud_of(true, seen, rng, false=25)
    chosen, predicted = register(REST, cloud.positions, cloud.points.covariance)
    assert np.mean(chosen[seen] == index[seen]) > 0.95
    assert (chosen[chosen >= 0] == index[chosen >= 0]).mean() > 0.95
    assert np.median(np.linalg.norm(predicted - true, axis=1)) < 2e-3


def test_points_of_nothing_are_no_wing() -> None:
    rng = np.random.default_rng(1)
    covariance = np.tile(DEVIATION**2 * np.eye(3), (12, 1, 1))
    chosen, _ = register(REST, rng.uniform(-3, 3, (12, 3)), covariance)
    assert (chosen < 0).all()
    for few in (0, 2):
        chosen, _ = register(REST, rng.uniform(0, 1, (few, 3)), covariance[:few])
        assert (chosen < 0).all()


def test_markers_not_found_move_with_the_others() -> None:
    noise = 10 * DEVIATION * np.random.default_rng(6).standard_normal(REST.shape)
    true, surface = moved(REST, 0.11) + noise, surface_of(REST)
    hidden = np.zeros(49, dtype=bool)
    hidden[[10, 40, 41, 47, 48]] = True  # one in the middle, four at a corner
    found = np.where(hidden[:, None], np.nan, true)
    result = deformed(surface, found, REST)
    errors = np.linalg.norm(result.positions - true, axis=1)
    assert errors[hidden].max() < 0.02
    assert (errors[hidden] < 5 * np.sqrt(3) * result.deviation[hidden]).all()
    assert result.deviation[48] > 1.1 * result.deviation[~hidden].mean()
    nothing = deformed(surface, np.where(ALL[:, None], np.nan, true), REST)
    assert np.isnan(nothing.positions).all()


def test_each_point_is_one_marker() -> None:
    """Two markers want the nearer of two points: the sum of the squares decides; the third finds none."""
    predicted = np.array([[0, 0, 0], [0.001, 0, 0], [1.0, 0, 0], [np.nan, 0, 0]])
    points = np.array([[0.001, 0, 0], [-0.001, 0, 0]])
    covariance = np.tile(1e-8 * np.eye(3), (2, 1, 1))
    chosen = assign(predicted, np.full(4, 1e-3), points, covariance)
    assert list(chosen) == [1, 0, -1, -1]


def followed(present: Mask, false: int, rate: float, seed: int = 2) -> tuple[Followed, Array, Array]:
    """The result, the index [T, K] of each marker's point, and the truth, for markers ``present`` [T, K]."""
    rng = np.random.default_rng(seed)
    clouds, index, true = [], [], []
    for number, seen in enumerate(present):
        true.append(moved(REST, number / rate))
        cloud, own = cloud_of(true[-1], seen, rng, false)
        clouds.append(cloud)
        index.append(own)
    calls: list[tuple[int, int]] = []
    result = follow(clouds, REST, surface_of(REST), lambda done, of: calls.append((done, of)))
    assert result is not None
    assert calls[-1] == (len(present), len(present))
    return result, np.array(index), np.array(true)


def test_a_marker_that_was_hidden_is_found_again() -> None:
    present = np.ones((60, 49), dtype=bool)
    present[20:30, 17] = False
    present[33:43, [3, 44]] = False
    present &= np.random.default_rng(3).random(present.shape) > 0.03
    result, index, true = followed(present, 15, 30 * BEAT)
    right = result.chosen == index
    assert right[present].mean() > 0.995
    assert right[~present].mean() > 0.9  # a false point may be where a hidden marker would be
    for last, marker in ((29, 17), (42, 3), (42, 44)):
        again = last + 1 + np.flatnonzero(present[last + 1 :, marker])[:3]
        assert right[again, marker].all()
    hidden = np.linalg.norm(result.predicted - true, axis=2)[~present]
    assert np.median(hidden) < 1e-3


def test_instants_without_wing_are_left_out() -> None:
    present = np.ones((40, 49), dtype=bool)
    present[15:19] = False
    result, index, _ = followed(present, 5, 40 * BEAT)
    assert (result.chosen[15:19] == -1).all()
    assert np.isnan(result.predicted[15:19]).all()
    assert (result.chosen[present.all(1)] == index[present.all(1)]).mean() > 0.995


def test_no_wing_is_nothing_to_follow() -> None:
    rng = np.random.default_rng(4)
    empty = [cloud_of(moved(REST, 0.0), ~ALL, rng, 9)[0] for _ in range(5)]
    assert follow(empty, REST, surface_of(REST), lambda *_: None) is None


def test_jumps_are_found_and_nothing_else() -> None:
    rng = np.random.default_rng(5)
    times = np.arange(80) / 150
    true = np.stack([moved(REST[::7], time) for time in times])
    seen = true + DEVIATION * rng.standard_normal(true.shape)
    seen[rng.random(seen.shape[:2]) < 0.05] = np.nan
    wrong = np.zeros(seen.shape[:2], dtype=bool)
    wrong[[10, 33, 60, 61], [0, 3, 5, 1]] = True
    seen[wrong] = true[wrong] + [0, 4e-3, 0]
    covariance = np.tile(DEVIATION**2 * np.eye(3), (*wrong.shape, 1, 1))
    assert np.array_equal(jumps(times, seen, covariance, 1e-3), wrong)
    assert not jumps(times[:4], seen[:4], covariance[:4], 1e-3).any()  # too few to say
