"""Recordings of the same cameras get one frame, and the flap frequency on the cameras' clock."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.tracking.alignment.recorded import filmed
from wingfit import DatasetError
from wingfit.tracking.alignment import AlignedTracks, Known, align, in_common_frame
from wingfit.tracking.alignment.flapping import refined, true_frequency


def turned(one: AlignedTracks, degrees: tuple[float, float, float], shift: tuple[float, float, float]) -> AlignedTracks:
    """Return the same tracks as if the frame had been found with these errors (wing axes, m)."""
    turn = Rotation.from_euler("xyz", degrees, degrees=True).as_matrix() @ one.rotation
    origin = one.origin + np.array(shift) @ one.rotation
    world = one.positions @ one.rotation + one.origin
    return replace(one, rotation=turn, origin=origin, positions=(world - origin) @ turn.T)


@pytest.fixture(scope="module", params=["left", "right"])
def found(request: pytest.FixtureRequest) -> AlignedTracks:
    film = filmed(left=request.param == "left")
    return align(film.tracks, film.wing, Known(side=request.param))


def test_errors_of_single_frames_cancel_and_all_recordings_share_one(found: AlignedTracks) -> None:
    errors = ((0.1, 0.05, -0.1), (1e-4, 0, 0)), ((-0.1, -0.05, 0.1), (-1e-4, 0, 0))
    every = in_common_frame([turned(found, *one) for one in errors])
    for one in every:
        np.testing.assert_allclose(one.rotation, found.rotation, atol=1e-5)
        np.testing.assert_allclose(one.positions, found.positions, atol=1e-5)
        np.testing.assert_allclose(one.results[0].rest_m, found.results[0].rest_m, atol=1e-3)
    assert np.array_equal(every[0].rotation, every[1].rotation)


def test_a_single_recording_stays_as_it_is(found: AlignedTracks) -> None:
    (same,) = in_common_frame([found])
    np.testing.assert_allclose(same.positions, found.positions, atol=1e-12)


@pytest.mark.parametrize(
    ("degrees", "shift", "message"),
    [((0, 3, 0), (0, 0, 0), "turned about the wing's y"), ((0, 0, 0), (0, 0.02, 0), "shifted along the wing's y")],
)
def test_cameras_that_moved_are_named(
    found: AlignedTracks, degrees: tuple[float, float, float], shift: tuple[float, float, float], message: str
) -> None:
    moved = replace(turned(found, degrees, shift), file="moved.csv")
    with pytest.raises(DatasetError, match=f"(?s)moved.csv.*{message}.*align it by itself"):
        in_common_frame([found, found, found, moved])


def test_wings_of_both_sides_are_refused(found: AlignedTracks) -> None:
    other = replace(found, side="left" if found.side == "right" else "right", file="other.csv")
    with pytest.raises(DatasetError, match="recordings of one wing"):
        in_common_frame([found, other])


def test_all_markers_give_the_frequency_to_the_noise_of_the_cameras() -> None:
    times = np.arange(60) / 3.1
    rng = np.random.default_rng(1)
    phase = 2 * np.pi * 3.00006 * times[:, None, None]
    places = 0.1 * np.cos(phase + rng.uniform(0, 6, (1, 20, 3))) + 2e-5 * rng.standard_normal((60, 20, 3))
    places[rng.uniform(size=(60, 20)) < 0.2] = np.nan
    apparent = refined(times, places, 0.1001)
    # The standard error of a frequency is sqrt(6 / N) noise / (pi amplitude T), Rife and Boorstyn (1974).
    error = np.sqrt(6 / (60 * 60 * 0.8)) * 2e-5 / (np.pi * 0.1 * 60 / 3.1)
    found = true_frequency(apparent, 1 / 3.1, 3.0)
    assert found == pytest.approx(3.00006, abs=4 * error)


@pytest.mark.parametrize(
    ("set_hz", "expected"), [(3.02, 2.9999), (3.21, 3.2001), (2.6, None), (3.1, None), (12.5, 12.5001)]
)
def test_the_frequency_near_the_one_that_was_set(set_hz: float, expected: float | None) -> None:
    found = true_frequency(0.1001, 1 / 3.1, set_hz)
    assert found == (expected if expected is None else pytest.approx(expected, abs=1e-9))


def test_a_frequency_that_the_frames_cannot_show_is_refused() -> None:
    film = filmed(left=False)
    for value, message in ((1.3 / np.median(np.diff(film.tracks.times)), "which no frequency"), (-1.0, "from 0.01")):
        with pytest.raises(DatasetError, match=message):
            align(film.tracks, film.wing, Known(side="right", flap_frequency_hz=value))


def test_the_stated_frequency_of_a_fast_camera_is_the_apparent_one() -> None:
    film = filmed(left=False)
    plain = align(film.tracks, film.wing, Known(side="right")).flap_frequency
    stated = align(film.tracks, film.wing, Known(side="right", flap_frequency_hz=1.01 * plain))
    assert stated.flap_frequency == pytest.approx(plain, rel=1e-12)
