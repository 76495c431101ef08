"""Alignment of recordings whose frame and labels are known."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.oracles.alignment import Unsettled, grid_wing, rigid, tracks_of, unsettled
from tests.tracking.alignment.recorded import Filmed, filmed, turned_by
from wingfit import DatasetError
from wingfit.records.array_types import Array
from wingfit.records.wing import Structure
from wingfit.tracking.alignment import AlignedTracks, Known, Tracks, align


def same(found: AlignedTracks, film: Filmed) -> Array:
    """Distance [T, N] of aligned from true positions of the same marker, m; NaN where one is not there."""
    order = [film.markers.index(name) for name in found.markers]
    return np.asarray(np.linalg.norm(found.positions - film.true[:, order], axis=-1))


@lru_cache
def a_left_wing() -> tuple[Filmed, AlignedTracks]:
    """Align an unnamed left wing with two swapped labels, a spurious track and an outlier."""
    film = filmed(left=True)
    positions = film.tracks.positions.copy()
    positions[20:35, [3, 30]] = positions[20:35, [30, 3]]
    positions[40, 7] += (0.05, 0.04, -0.05)
    reflection = np.full((len(positions), 1, 3), positions[0, 5] + 0.1)
    names = (*film.tracks.names, "reflection")
    tracks = Tracks("trial.csv", film.tracks.times, names, np.concatenate([positions, reflection], axis=1))
    return film, align(tracks, film.wing, Known())


def test_the_frame_and_the_side_are_found() -> None:
    _, found = a_left_wing()
    assert found.side == "left"
    assert found.side_evidence is not None
    assert found.side_evidence > 50
    assert np.linalg.det(found.rotation) == pytest.approx(-1)
    assert turned_by(found.rotation, left=True) < 0.5
    assert np.linalg.norm(found.origin - (0.4, -0.2, 1.5)) < 1e-3
    errors = np.degrees(found.rotation_error)
    assert (errors > 0.05).all()
    assert (errors < 0.5).all()


def test_unnamed_tracks_get_their_names_and_swaps_are_repaired() -> None:
    film, found = a_left_wing()
    assert found.markers == film.markers
    away = same(found, film)
    assert np.nanmax(away) < 6e-3  # a frame that is 0.5 deg wrong moves the tip by 4 mm
    swapped = {(one.track, one.marker, one.frames) for one in found.exchanges}
    seen = np.isfinite(film.true[20:35, :, 0]).sum(axis=0)
    assert swapped == {("t3", film.markers[30], seen[30]), ("t30", film.markers[3], seen[3])}


def test_what_does_not_belong_is_dropped_with_a_word() -> None:
    film, found = a_left_wing()
    assert [one.track for one in found.dropped] == ["reflection"]
    assert "near no free marker" in found.dropped[0].reason
    assert found.lost_samples == 1
    assert np.isnan(found.positions[40, list(found.markers).index(film.markers[7])]).all()


def test_rest_positions_have_errors_that_fit() -> None:
    film, found = a_left_wing()
    described = {one.name: one.position for one in film.wing.markers}
    for one in found.results:
        assert np.linalg.norm(np.subtract(one.rest_m, described[one.marker])) == pytest.approx(one.moved_m)
        assert one.moved_m < 2e-3
        assert all(1e-5 < error < 1e-3 for error in one.rest_error_m)
    count = 3 * len(found.markers)
    assert found.rest_covariance.shape == (count, count)
    assert np.linalg.eigvalsh(found.rest_covariance).min() > 0


def test_names_that_are_wrong_are_corrected_and_mentioned() -> None:
    film = filmed(5)
    names = list(film.markers)
    names[2], names[9] = names[9], names[2]
    found = align(film.renamed(tuple(names)).tracks, film.wing, Known())
    assert found.side == "right"
    assert turned_by(found.rotation) < 0.5
    assert np.nanmax(same(found, film)) < 6e-3
    assert sum("its name is wrong" in remark for remark in found.remarks) == 2


def moving(film: Filmed, turn: float) -> tuple[Array, Array]:
    """Rotation [T, 3, 3] and shift [T, 3] (m) of a body that turns by up to ``turn`` (rad) and moves by centimetres."""
    s = np.linspace(-1, 1, len(film.tracks.times))
    rotation = Rotation.from_rotvec(turn * s[:, None] * [0.5, 0.6, -0.6]).as_matrix()
    return rotation, 0.04 * np.stack([s, 0.5 - s**2, -s], axis=-1)


def test_slow_motion_of_the_body_is_removed() -> None:
    film = filmed(1)
    rotation, shift = moving(film, 0.1)
    moved = np.einsum("tij,tkj->tki", rotation, film.tracks.positions) + shift[:, None]
    found = align(film.filmed_by(moved).tracks, film.wing, Known(side="right"))
    assert any("moves slowly" in remark for remark in found.remarks)
    assert np.nanmax(same(found, film)) < 8e-3


def test_motion_of_a_body_with_markers_is_removed() -> None:
    film = filmed(1)
    rotation, shift = moving(film, 0.3)
    heave = 0.02 * np.sin(np.arange(len(shift)))[:, None]
    noise = 5e-4 * np.random.default_rng(0).standard_normal((len(shift), 4, 3))
    body = np.array([[0.3, 0.1, 1.5], [0.5, 0.0, 1.7], [0.2, -0.1, 1.4], [0.4, -0.4, 1.6]]) + noise
    every = np.concatenate([film.tracks.positions, body], axis=1)
    moved = np.einsum("tij,tkj->tki", rotation, every) + (shift + heave)[:, None]
    names = ("a", "b", "c", "d")
    tracks = Tracks("trial.csv", film.tracks.times, (*film.tracks.names, *names), moved)
    found = align(tracks, film.wing, Known(body=names, side="right"))
    assert np.nanmax(same(found, film)) < 8e-3
    with pytest.raises(DatasetError, match=r"--body: a, b, c, t39 are not rigid"):
        align(tracks, film.wing, Known(body=("a", "b", "c", "t39")))


# The benchmark has one more, which takes long: a wing whose markers are elsewhere.
@pytest.mark.parametrize(
    "case", [case for case in unsettled() if "other places" not in case.name], ids=lambda case: case.name
)
def test_what_nobody_can_know_is_refused(case: Unsettled) -> None:
    with pytest.raises(DatasetError) as caught:
        align(case.tracks, case.wing, Known())
    remedies = ("--side", "--label", "needed", "--mean-flap-deg", "unit", "check", "accepted")
    assert any(remedy in str(caught.value) for remedy in remedies)


def test_a_statement_settles_it() -> None:
    wing = grid_wing(4, flat=True, symmetric=False)
    positions = rigid(wing)
    assert align(tracks_of(positions), wing, Known(side="left")).side == "left"
    found = align(tracks_of(positions), wing, Known(side="right"))
    assert found.side == "right"
    assert found.side_evidence is None
    up = found.rotation[2]
    axis = int(np.argmax(np.abs(up)))
    direction = ("" if up[axis] > 0 else "-") + "xyz"[axis]
    assert align(tracks_of(positions), wing, Known(up=direction)).side == "right"


@pytest.mark.parametrize("structure", ["rigid", "sheet"])
def test_a_wing_without_rods_is_aligned(structure: Structure) -> None:
    wing = grid_wing(4, flat=False, symmetric=False)
    animal = replace(wing, structure=structure, rods=(), driven_rods=())
    tracks = tracks_of(rigid(wing))
    with_rods, without = align(tracks, wing, Known()), align(tracks, animal, Known())
    assert without.side == with_rods.side == "right"
    assert without.markers == with_rods.markers
    assert np.abs(without.rotation - with_rods.rotation).max() < 0.002  # rad
    assert np.abs(without.positions - with_rods.positions).max() < 5e-4  # m


def test_wrong_statements_are_listed() -> None:
    film = filmed()
    known = Known(side="up", up="w", labels={"t99": "m01", "t1": "m99"}, body=("t1", "t2"), mean_flap_deg=120)  # type: ignore[arg-type]
    with pytest.raises(DatasetError) as caught:
        align(film.tracks, film.wing, known)
    text = str(caught.value)
    for words in ("left or right", "-x, -y or -z", "'t99'", "'m99'", "needs 3", "120 deg"):
        assert words in text
