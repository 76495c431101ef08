"""What the tracks contradict, tracks that are no wing's, long recordings, and errors of a body's pose."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.oracles.alignment import grid_wing
from tests.tracking.alignment.recorded import PLACE, TURN, filmed, turned_by
from wingfit import DatasetError
from wingfit.cli.base import output
from wingfit.records.array_types import Array
from wingfit.tracking.alignment import Known, Tracks, align
from wingfit.tracking.alignment.flapping import strongest
from wingfit.tracking.alignment.pose_error import PoseError
from wingfit.tracking.alignment.rigid_motion import distance_changes, rigid_motion


def refusal(positions: Array, known: Known | None = None) -> str:
    film = filmed(left=True)
    names = film.tracks.names[: positions.shape[1]]
    with pytest.raises(DatasetError) as caught:
        align(Tracks("trial.csv", film.tracks.times, names, positions), film.wing, known or Known())
    return str(caught.value)


def test_the_wrong_side_is_refused() -> None:
    text = refusal(filmed(left=True).tracks.positions, Known(side="right"))
    for words in ("those of a left wing", "ln of the odds against --side right", "at most 6", "Leave --side away"):
        assert words in text


def test_up_that_is_down_is_refused() -> None:
    film = filmed()
    up = TURN[:, 2]
    axis = int(np.argmax(np.abs(up)))
    right, wrong = (("-" if sign * up[axis] < 0 else "") + "xyz"[axis] for sign in (1, -1))
    assert align(film.tracks, film.wing, Known(up=right)).side == "right"
    with pytest.raises(DatasetError, match=r"those of a right wing.*--up"):
        align(film.tracks, film.wing, Known(up=wrong))


def test_tracks_that_are_no_wing_are_refused_with_numbers() -> None:
    positions = filmed(left=True).tracks.positions
    mixed = positions.copy()
    mixed[31:] = mixed[31:, np.random.default_rng(1).permutation(positions.shape[1])]
    text = refusal(mixed)
    assert "distances between them vary by" in text
    assert "at most 4.9 mm" in text
    line = positions[:, :1] + np.arange(6)[:, None] * (0.02, 0.0, 0.0)
    assert "lie on one line" in refusal(line)
    assert "lie on one line" in refusal(np.ones_like(positions))
    assert "0 frames show 5" in refusal(np.full_like(positions, np.nan))
    infinite = positions.copy()
    infinite[5, 2] = np.inf
    assert "'t2' is infinite" in refusal(infinite)


def test_labels_that_swap_in_half_of_the_recording_and_tracks_on_the_hinge() -> None:
    film = filmed(left=True)
    positions = film.tracks.positions.copy()
    positions[31:, [3, 30]] = positions[31:, [30, 3]]
    hinge = np.array([[0.05, 0.0, 0.0], [0.12, 0.0, 0.0]]) @ TURN.T + PLACE
    every = np.concatenate([positions, np.broadcast_to(hinge, (len(positions), 2, 3))], axis=1)
    found = align(Tracks("t", film.tracks.times, (*film.tracks.names, "h1", "h2"), every), film.wing, Known())
    assert found.side == "left"
    assert turned_by(found.rotation, left=True) < 0.5  # deg
    assert [one.track for one in found.dropped] == ["h1", "h2"]
    assert {one.track for one in found.exchanges} == {"t3", "t30"}


def long_recording(frames: int, per_beat: float) -> tuple[Tracks, Array]:
    """Return a left wing that turns rigidly, tracks [frames, K, 3], and its angles, rad."""
    wing = grid_wing(4, flat=False, symmetric=False)
    rest = np.array([one.position for one in wing.markers])
    angle = 0.6 * np.sin(2 * np.pi * np.arange(frames) / per_beat)
    turned = np.einsum("tij,mj->tmi", Rotation.from_rotvec(angle[:, None] * [1.0, 0.0, 0.0]).as_matrix(), rest)
    noise = 3e-4 * np.random.default_rng(3).standard_normal(turned.shape)
    positions = turned * (1, -1, 1) @ TURN.T + PLACE + noise
    return Tracks("long", np.arange(frames) / 300.0, tuple(f"t{k}" for k in range(len(rest))), positions), angle


def test_a_long_recording_is_aligned_in_seconds() -> None:
    tracks, angle = long_recording(9000, 30.0)  # frames at even steps of 30 would show one phase of the beat only
    wing, parts = grid_wing(4, flat=False, symmetric=False), list[float]()
    began = time.process_time()
    found = align(tracks, wing, Known(), parts.append)
    assert time.process_time() - began < 60  # s; about 10 on one core of an AMD EPYC
    assert found.side == "left"
    assert turned_by(found.rotation, left=True) < 0.5
    assert found.flap_frequency == pytest.approx(10.0, rel=1e-3)
    assert np.isfinite(found.positions).mean() > 0.999
    tip = found.positions[:, -1]
    seen = np.arctan2(tip[:, 2], tip[:, 1])
    assert np.abs(seen - seen.mean() - angle).max() < 0.02
    assert parts == sorted(parts)
    assert len(parts) >= 3


def test_the_strongest_line_of_a_long_recording() -> None:
    t = np.arange(5000) / 100.0
    angle = 0.3 * np.cos(2 * np.pi * 3.217 * t) + 0.05 * np.cos(2 * np.pi * 6.434 * t) + 0.01 * t
    angle[100:130] = np.nan
    assert strongest(t, angle) == pytest.approx(3.217, abs=1e-4)


def test_the_first_look_survives_swapped_first_frames_and_still_tracks() -> None:
    tracks, angle = long_recording(60, 28.0)
    positions = tracks.positions.copy()
    positions[:25, [1, 18]] = positions[:25, [18, 1]]
    still = np.broadcast_to(positions[0, :4] + 0.1, (60, 4, 3))
    every = np.concatenate([positions, still], axis=1)
    motion = rigid_motion(every)
    assert np.ptp(motion.angle) == pytest.approx(np.ptp(angle), rel=0.05)
    assert (motion.weight[-4:] < 0.1).all()
    change = np.nanmedian(distance_changes(every), axis=0)
    assert change[:20].max() < 2e-3 < change[20:].min()


def test_errors_of_a_pose_turn_about_the_markers() -> None:
    """A rotation about the middle of the markers moves the hinge by rotation x lever; checked against samples."""
    rng = np.random.default_rng(0)
    turn = np.diag([1.0, 1.0, -1.0]) @ Rotation.random(random_state=4).as_matrix()
    middle, hinge = np.array([0.1, -0.2, 0.3]), np.array([0.2, 0.1, 0.15])
    spread = np.diag([1e-4, 4e-4, 2e-4])
    error = PoseError(spread, 1e-2, middle)
    turns = rng.normal(size=(200_000, 3)) * np.sqrt(np.diag(spread))
    shift = np.cross(turns, hinge - middle) + 1e-2 * rng.normal(size=turns.shape)
    axial = np.linalg.det(turn) * turns @ turn.T
    samples = np.concatenate([axial[:, 1:], shift @ turn.T], axis=1)
    covariance = error.covariance(turn, hinge)
    scale = np.sqrt(np.diag(covariance))
    assert np.abs(np.cov(samples.T) - covariance).max() < 0.02 * (scale[:, None] * scale).max()
    assert np.allclose(PoseError(spread, 1e-2, middle, 4.0).covariance(turn, hinge), 4 * covariance)


def test_progress_is_shown_of_long_work_only(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with output.late_progress("aligning") as report:
        report(0.5)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(output, "LATE_S", -1.0)
    with output.late_progress("aligning") as report:
        report(0.5)
    assert "aligning" in capsys.readouterr().err
