"""The experiments that the renderer offers: wings, films, their truth, and the files of the command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.cameras.renderer.film import Film
from benchmarks.cameras.renderer.presets import BEAT, continuous, thesis_strobe, three_cameras_late, with_rod
from benchmarks.cameras.renderer.scene import Scene
from benchmarks.cameras.renderer.sensor import Image
from benchmarks.cameras.renderer.simulated import edge_weights, periodic, simulated_scene, slope_weights
from benchmarks.cameras.renderer.truth import Truth, truth_of
from benchmarks.cameras.renderer.wings import Flapping, analytic_scene
from wingfit.records.array_types import Array
from wingfit.sim.virtual_rigs.campaign import robird_wing, vacuum

TIMES = np.linspace(0.0, 1.0 / BEAT, 7)


def contrast(film: Film, truth: Truth, camera: int, flash: int) -> Array:
    """Grey levels [K, 5] of a frame at each marker's white, white, black and black square, and the brightest possible.

    Only of markers that a whole flash lights in that frame.
    """
    cam, rows, images = film.cameras[camera], [], dict[int, Image]()
    poses = film.scene.poses(truth.times[flash : flash + 1])
    for k, size in enumerate(film.scene.sizes):
        if truth.lit[camera, flash, k] < 0.999 or truth.visible[camera, flash, k] < 1:
            continue
        frame = int(truth.frames[camera, flash, k])
        image = images[frame] if frame in images else images.setdefault(frame, film.frame(cam, frame))
        u, v = poses.axes[0, k, 0], poses.axes[0, k, 1]
        places = [poses.positions[0, k] + size / 4 * (a * u + b * v) for a, b in ((1, 1), (-1, -1), (1, -1), (-1, 1))]
        x, y = np.rint(cam.project(np.array(places))).astype(int).T
        rows.append([*image[y, x], image[y.min() - 3 : y.max() + 4, x.min() - 3 : x.max() + 4].max()])
    return np.array(rows, float)


def test_a_film_shows_the_markers_where_the_truth_is() -> None:
    film = thesis_strobe(scale=0.6, flashes=2, seed=4).film
    truth = truth_of(film)
    assert truth.pixels.shape == (2, 2, 49, 2)
    for camera, flash in ((0, 0), (1, 1)):
        levels = contrast(film, truth, camera, flash)
        assert len(levels) > 30
        assert (levels[:, :2] > 0.7 * levels[:, 4:]).all()
        assert (levels[:, 2:4] < 0.4 * levels[:, 4:]).all()
    dark = film.frame(film.cameras[0], int(truth.frames[0, 0].max()) + 3)
    assert dark.mean() < 5
    assert np.abs(film.cameras[1].project(truth.positions) - truth.pixels[1]).max() < 1e-6


def test_the_late_camera_sees_a_later_wing() -> None:
    film = three_cameras_late(scale=0.2, beats=0.1).film
    truth = truth_of(film)
    assert truth.instants[2] - truth.instants[0] == pytest.approx(np.full(truth.instants[0].shape, 2e-3))
    for camera, seen, instants in zip(film.cameras, truth.pixels, truth.instants, strict=True):
        poses = film.scene.poses(instants[:, 0])
        assert np.abs(camera.project(poses.positions) - seen).max() < 1e-3
    frame = film.frame(film.cameras[2], 1)
    assert frame.max() > 60


def test_beats_fill_the_continuous_film() -> None:
    film = continuous(scale=0.1, beats=3.0).film
    assert film.frames(film.cameras[0]) == 500
    assert film.cameras[0].size == (128, 102)


def test_a_rod_hides_markers_now_and_then() -> None:
    film = thesis_strobe(scale=0.2, flashes=5, scene=with_rod(analytic_scene(Flapping(BEAT)))).film
    visible = truth_of(film).visible
    assert 0 < (visible == 0).sum() < 0.3 * visible.size


def test_an_untwisted_wing_turns_about_its_hinge() -> None:
    wing = Flapping(frequency=2.0, twist=0.0, bending=0.0, bias=0.1, flap=0.4, hinge=(0.0, 0.02, -0.01))
    moved = wing.moved(np.array([0.0, 0.25]), wing.markers())
    for place, angle in zip(moved, (0.5, -0.3), strict=True):
        x, y = wing.markers().T
        expected = np.stack([x, 0.02 + y * np.cos(angle), -0.01 + y * np.sin(angle)], axis=1)
        assert place == pytest.approx(expected, abs=1e-12)
    normal = wing.poses(np.zeros(1), wing.markers()).axes[0, :, 2]
    assert normal == pytest.approx(np.tile([0, -np.sin(0.5), np.cos(0.5)], (49, 1)))


@pytest.fixture(scope="module")
def simulated() -> Scene:
    return simulated_scene(vacuum(100.0, 0.05, BEAT))


def test_the_simulated_wing_has_the_tracks_of_its_effects(simulated: Scene) -> None:
    other = simulated_scene(vacuum(100.0, 0.05, BEAT), {"hinge_offset.y": 0.03})
    moved = other.poses(TIMES).positions - simulated.poses(TIMES).positions
    assert 1e-3 < np.abs(moved).max() < 0.06
    positions, axes = simulated.poses(TIMES)
    assert positions[0] == pytest.approx(positions[-1])
    assert axes @ np.swapaxes(axes, -1, -2) == pytest.approx(np.broadcast_to(np.eye(3), axes.shape))
    assert axes[:, :, 2, 2].min() > 0.5  # normals point up
    film = thesis_strobe(scale=0.2, flashes=3, scene=simulated).film
    assert truth_of(film).visible.min() == 1.0  # the surface that carries them does not hide them


def test_a_value_beyond_its_limits_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"hinge_offset\.y"):
        simulated_scene(vacuum(100.0, 0.05, BEAT), {"hinge_offset.y": 1e6})


def test_a_wing_that_moves_as_a_plane_has_the_slopes_and_edges_of_the_plane() -> None:
    wing = robird_wing()
    plan = np.array([marker.position for marker in wing.markers])[:, :2]
    slopes = np.array([[0.9, 0.1, 0.3], [-0.2, 0.8, 0.5]])
    positions = plan @ slopes + [0.1, 0.2, 0.3]
    assert slope_weights(plan) @ positions == pytest.approx(np.broadcast_to(slopes, (49, 2, 3)))
    edges = edge_weights(wing, plan) @ positions
    corner = np.array([wing.stations[-1].leading_edge, wing.stations[-1].y])
    assert edges.reshape(9, 9, 3)[8, 0] == pytest.approx(corner @ slopes + [0.1, 0.2, 0.3])


def test_a_periodic_track_is_interpolated_exactly() -> None:
    def track(beats: Array) -> Array:
        turns = 2 * np.pi * np.asarray(beats)[:, None, None]
        return np.asarray(0.3 + np.array([1.0, 2.0, 3.0]) * np.cos(turns) + 0.2 * np.sin(3 * turns + 0.4))

    for steps in (9, 12):
        found = periodic(track(np.arange(steps) / steps), np.array([0.123, 2.77]))
        assert found == pytest.approx(track(np.array([0.123, 2.77])))


def test_the_command_writes_what_was_filmed(tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    from benchmarks.cameras import render  # it needs OpenCV

    render.main(
        ["thesis_strobe", str(tmp_path), "--flashes", "2", "--scale", "0.1", "--wand", "0.5", "--suffix", ".mkv"]
    )
    film = thesis_strobe(scale=0.1, flashes=2).film
    video = cv2.VideoCapture(str(tmp_path / "wing-right.mkv"))
    for expected in film.images(film.cameras[1]):
        assert np.array_equal(video.read()[1][..., 0], expected)
    assert not video.read()[0]
    wand = cv2.VideoCapture(str(tmp_path / "wand-left.mkv"))
    assert int(wand.get(cv2.CAP_PROP_FRAME_COUNT)) == 31
    described = json.loads((tmp_path / "cameras.json").read_text(encoding="utf-8"))
    assert described[1]["translation"] == film.cameras[1].translation.tolist()
    with np.load(tmp_path / "truth.npz") as saved:
        assert saved["positions"] == pytest.approx(truth_of(film).positions)
    with np.load(tmp_path / "boards.npz") as boards:
        assert boards["corners"].shape == (2, 24, 54, 2)
        pixels = np.rint(boards["corners"][0, 0]).astype(int)
    board = cv2.imread(str(tmp_path / "boards-left" / "00.png"), cv2.IMREAD_GRAYSCALE)
    x, y = np.clip(pixels, 0, np.array(board.shape)[::-1] - 1).T
    assert board.shape == film.cameras[0].size[::-1]
    assert np.ptp(board[y, x].astype(float)) > 20  # corners, not background


@pytest.mark.parametrize(
    "words", [["continuous", "x", "--flashes", "3"], ["thesis_strobe", "x", "--beats", "3"],
              ["continuous", "x", "--gene", "hinge_offset.y=0.1"], ["continuous", "x", "--gene", "hinge_offset.y"]]
)  # fmt: skip
def test_options_without_effect_are_errors(words: list[str]) -> None:
    pytest.importorskip("cv2")
    from benchmarks.cameras import render  # it needs OpenCV

    with pytest.raises(SystemExit):
        render.main(words)
