"""The location of a misfit along the wing, from the markers that show it."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from wingfit.diagnosis.location.differences import _extent_along
from wingfit.diagnosis.subject import ChannelLocation


def misfit(stations: Sequence[float], sizes: Sequence[float]) -> Any:
    """One recording with a marker at each of the ``stations`` with mean square misfits ``sizes``."""
    places = tuple(ChannelLocation(f"m{k}", "z", at, 0.5, 0.0, at) for k, at in enumerate(stations))
    return [SimpleNamespace(locations=places, excess=np.array(sizes, float))]


def along(stations: Sequence[float], sizes: Sequence[float]) -> tuple[float, float, float]:
    found = _extent_along(cast("Any", misfit(stations, sizes)), "span")
    assert found is not None
    assert found.low is not None
    assert found.high is not None
    return found.low, found.value, found.high


def test_the_median_is_symmetric() -> None:
    low, middle, high = along([0.2, 0.8], [1.0, 1.0])
    assert middle == pytest.approx(0.5)
    assert (low, high) == pytest.approx((0.05, 0.95))
    assert along([0.1, 0.3, 0.5, 0.7, 0.9], np.ones(5).tolist())[1] == pytest.approx(0.5)


def test_a_marker_represents_half_the_distance_to_its_neighbours() -> None:
    low, middle, high = along([0.1, 0.3, 0.5, 0.7, 0.9], [0.0, 0.0, 1.0, 0.0, 0.0])
    assert middle == pytest.approx(0.5)
    assert (low, high) == pytest.approx((0.41, 0.59))


def test_markers_at_one_station_are_added() -> None:
    assert along([0.8, 0.2, 0.8], [0.5, 1.0, 0.5])[1] == pytest.approx(0.5)
    assert along([0.4, 0.4], [1.0, 2.0]) == pytest.approx((0.4, 0.4, 0.4))


def test_no_misfit_has_no_location() -> None:
    assert _extent_along(cast("Any", misfit([0.2, 0.8], [0.0, 0.0])), "span") is None
