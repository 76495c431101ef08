"""The renderer of films against closed forms: optics, shutter, light, occlusion, noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.cameras.renderer.boards import Board, BoardPose, Wand, board_light
from benchmarks.cameras.renderer.film import Film
from benchmarks.cameras.renderer.film_camera import PAD, FilmCamera, Sensor, aimed
from benchmarks.cameras.renderer.light import Light, Strobe
from benchmarks.cameras.renderer.scene import Glare, Kind, Poses, Rod, Scene, Surface
from benchmarks.cameras.renderer.sensor import Readout
from benchmarks.cameras.renderer.truth import truth_of
from wingfit.records.array_types import Array

FOCAL = 800.0
LEVEL = 100.0  # grey levels of a reflecting point at 1 m after one exposure
CLEAR = Sensor(blur=0.6, electrons=np.inf, read=0.0, black=0.0, vignetting=0.0)
CAMERA = FilmCamera(
    "cam", (320, 240), np.array([[FOCAL, 0, 158.3], [0, FOCAL, 121.6], [0, 0, 1.0]]), np.zeros(5),
    np.eye(3), np.zeros(3), rate=100.0, exposure=1e-3, sensor=CLEAR,
)  # fmt: skip
DISTORTED = replace(CAMERA, distortion=np.array([-0.3, 0.1, 1e-3, -2e-3, 0.02]))
FACING = np.diag([1.0, -1.0, -1.0])  # axes of a marker parallel to the image, towards the camera


def turned(tilt: float, turn: float) -> Array:
    """Axes of a marker that is turned in its plane, then tilted about the camera's x."""
    c, s, a, b = np.cos(turn), np.sin(turn), np.cos(tilt), np.sin(tilt)
    inside = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ FACING
    return np.asarray(inside @ np.array([[1, 0, 0], [0, a, b], [0, -b, a]]))


def one(
    place: Array, kind: Kind = "dot", axes: Array = FACING, speed: tuple[float, float, float] = (0, 0, 0),
    size: float = 0.012, rods: tuple[Rod, ...] = (), surface: Surface | None = None,
) -> Scene:  # fmt: skip
    """One marker that moves straight through ``place`` at time 0; it is as bright from all sides."""

    def poses(times: Array) -> Poses:
        moved = np.asarray(place) + times[:, None] * np.array(speed)
        return Poses(moved[:, None], np.broadcast_to(axes, (len(times), 1, 3, 3)))

    return Scene(poses, ("m",), np.array([size]), kind=kind, rods=rods, surface=surface, retro=0.0)


def lit(scene: Scene, camera: FilmCamera = CAMERA, frame: int = 0, over: int = 6) -> Array:
    """Light of one frame in continuous light."""
    light = film_of(scene, camera, over=over).light_of(camera, frame)
    assert light is not None
    return light


def film_of(scene: Scene, camera: FilmCamera = CAMERA, light: Light | None = None, over: int = 4) -> Film:
    return Film("test", scene, light or Light(continuous=LEVEL / camera.exposure), (camera,), 0.05, over=over)


def moments(image: Array) -> tuple[Array, Array]:
    """Centroid (x, y) and variances along x and y of an image."""
    y, x = np.indices(image.shape)
    centre = np.array([(image * x).sum(), (image * y).sum()]) / image.sum()
    spread = np.array([(image * (x - centre[0]) ** 2).sum(), (image * (y - centre[1]) ** 2).sum()]) / image.sum()
    return centre, spread


def test_rays_invert_the_projection() -> None:
    rays = DISTORTED.rays[PAD:-PAD, PAD:-PAD]
    y, x = np.indices(rays.shape[:2])
    seen = DISTORTED.image(np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=2))
    assert np.abs(seen - np.stack([x, y], axis=2)).max() < 1e-7


def test_the_distortion_is_that_of_brown() -> None:
    x, y = 0.3, -0.2
    rr = 0.13
    for k, (u, v) in enumerate(
        [(x * rr, y * rr), (x * rr**2, y * rr**2), (2 * x * y, rr + 2 * y * y), (rr + 2 * x * x, 2 * x * y),
         (x * rr**3, y * rr**3)]
    ):  # fmt: skip
        camera = replace(CAMERA, distortion=0.01 * np.eye(5)[k])
        moved = camera.image(np.array([x, y, 1.0])) - CAMERA.image(np.array([x, y, 1.0]))
        assert moved == pytest.approx(FOCAL * 0.01 * np.array([u, v]), abs=1e-9)


def test_the_projection_is_that_of_opencv() -> None:
    cv2 = pytest.importorskip("cv2")
    rotation, translation = aimed([0.1, 0.2, 1.0], [0.3, 0.1, 0.0], [0, 1, 0.2])
    camera = replace(DISTORTED, rotation=rotation, translation=translation)
    points = np.random.default_rng(1).uniform(-0.3, 0.3, (50, 3))
    turn, _ = cv2.Rodrigues(rotation)
    expected, _ = cv2.projectPoints(points, turn, translation, camera.matrix, camera.distortion)
    assert camera.project(points) == pytest.approx(expected[:, 0], abs=1e-9)


def test_a_smaller_image_shows_the_same() -> None:
    small = DISTORTED.scaled(0.25)
    assert small.size == (80, 60)
    point = np.array([0.1, -0.05, 0.7])
    assert small.project(point) + 0.5 == pytest.approx(0.25 * (DISTORTED.project(point) + 0.5))
    assert small.row_time * small.size[1] == DISTORTED.row_time * DISTORTED.size[1]


def test_a_clock_that_runs_fast_takes_frames_too_early() -> None:
    camera = replace(CAMERA, start=0.5, clock_error=1e-3, row_time=1e-5)
    starts, ends = camera.rows(1001)
    assert starts[7] == pytest.approx(0.5 + 1001 / 100.1 + 7e-5, abs=1e-12)
    assert ends[7] - starts[7] == pytest.approx(1e-3)
    assert list(camera.frames(float(starts[7]), float(ends[7]))) == [1001]


def test_a_camera_looks_at_its_target() -> None:
    rotation, translation = aimed([0.1, 0.2, 1.0], [0.3, 0.1, 0.0], [0, 1, 0])
    camera = replace(CAMERA, rotation=rotation, translation=translation)
    assert camera.project([0.3, 0.1, 0.0]) == pytest.approx([158.3, 121.6])
    assert camera.project([0.3, 0.15, 0.0])[0] > 158.3
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert camera.centre == pytest.approx([0.1, 0.2, 1.0])


@pytest.mark.parametrize("axes", [FACING, turned(0.6, 0.4), turned(-1.0, 2.0)])
def test_the_centroid_of_a_dot_is_that_of_its_ellipse(axes: Array) -> None:
    """The image of a circle is the conic whose dual is H diag(1, 1, -1) H', H = (r e1, r e2, c)."""
    centre = np.array([0.071, -0.043, 0.8])
    h = np.stack([0.02 * axes[0], 0.02 * axes[1], centre], axis=1)
    dual = h @ np.diag([1.0, 1.0, -1.0]) @ h.T
    expected = FOCAL * dual[:2, 2] / dual[2, 2] + [158.3, 121.6]
    found, _ = moments(lit(one(centre, axes=axes, size=0.04)))
    assert np.abs(found - expected).max() < 0.01


def test_a_ball_is_seen_as_the_ellipse_of_its_cone() -> None:
    centre, radius = np.array([0.11, 0.07, 0.8]), 0.03
    expected = FOCAL * centre[:2] * centre[2] / (centre[2] ** 2 - radius**2) + [158.3, 121.6]
    assert np.abs(expected - CAMERA.project(centre)).max() > 0.1  # the bias of a large ball is rendered too
    assert np.abs(moments(lit(one(centre, "ball", size=2 * radius)))[0] - expected).max() < 0.01


def test_a_small_dot_is_where_a_distorting_lens_puts_it() -> None:
    for place in ([0.12, 0.08, 0.75], [-0.13, -0.1, 0.8], [0.0, 0.1, 0.9]):
        found, _ = moments(lit(one(np.array(place), size=0.006), DISTORTED, over=8))
        assert np.abs(found - DISTORTED.project(place)).max() < 0.02


@pytest.mark.parametrize("turn", [0.0, 0.5, 2.2])
def test_the_centroid_of_a_chequer_is_its_centre(turn: float) -> None:
    place, size = np.array([0.05, -0.06, 0.9]), 0.016
    image = lit(one(place, "chequer", turned(0.0, turn), size=size))
    assert np.abs(moments(image)[0] - CAMERA.project(place)).max() < 0.01
    area = size**2 / 2 * (FOCAL / place[2]) ** 2
    assert image.sum() == pytest.approx(LEVEL / (place @ place) * area, rel=0.01)


def test_the_squares_between_the_tangents_are_white() -> None:
    axes, place = turned(0.5, 0.7), np.array([0.02, 0.03, 0.7])
    image = lit(one(place, "chequer", axes, size=0.02))

    def at(u: float, v: float) -> float:
        x, y = np.rint(CAMERA.project(place + 0.005 * (u * axes[0] + v * axes[1]))).astype(int)
        return float(image[y, x])

    assert min(at(1, 1), at(-1, -1)) > 0.95 * LEVEL / (place @ place)
    assert max(at(1, -1), at(-1, 1)) < 0.05 * LEVEL


def test_a_flash_lights_the_rows_that_are_exposed() -> None:
    row, duration = 15e-3 / 240, 0.5e-3
    camera = replace(
        CAMERA, rate=60.0, exposure=1 / 60, row_time=row, start=-0.004 - 1 / 60, sensor=replace(CLEAR, blur=0.0)
    )
    flash = Strobe(10.0, first=0.003, duration=duration, brightness=LEVEL, flashes=1)
    film = film_of(one(np.array([0.0, 0.0, 1.0]), size=0.26), camera, Light(flash), over=2)
    frames = [film.light_of(camera, frame) for frame in range(3)]
    assert frames[2] is None
    total = np.zeros(240)
    for frame, image in enumerate(frames[:2]):
        assert image is not None
        begin = -0.004 + (frame - 1) / 60 + row * np.arange(240)
        share = np.clip((np.minimum(begin + 1 / 60, 0.0035) - np.maximum(begin, 0.003)) / duration, 0, 1)
        column = image[60:180, 158] / LEVEL
        assert column == pytest.approx(share[60:180], abs=2e-3)
        assert 0 < column.mean() < 1
        total[60:180] += column
    assert total[60:180] == pytest.approx(np.ones(120), abs=2e-3)  # from 1 m, without a pause between frames


def test_motion_blurs_a_dot_by_its_path() -> None:
    still = lit(one(np.array([0.0, 0.0, 1.0])))
    speed = 12.0  # m/s: 9.6 pixels in an exposure
    moving = lit(one(np.array([0.0, 0.0, 1.0]), speed=(speed, 0, 0)))
    path = FOCAL * speed * CAMERA.exposure
    (centre, spread), (at_rest, before) = moments(moving), moments(still)
    assert centre == pytest.approx(at_rest + np.array([path / 2, 0]), abs=0.01)
    assert spread - before == pytest.approx([path**2 / 12, 0], abs=0.01 * path**2 / 12)


def test_a_rolling_shutter_sees_each_marker_when_its_row_is_exposed() -> None:
    camera = replace(CAMERA, row_time=15e-6 * 2)
    film = film_of(one(np.array([-0.02, -0.03, 1.0]), speed=(9.0, 12.0, 0)), camera, over=6)
    truth = truth_of(film)
    instant, pixel = truth.instants[0, 0, 0], truth.pixels[0, 0, 0]
    assert instant == pytest.approx(camera.row_time * pixel[1] + camera.exposure / 2, abs=1e-9)
    assert np.abs(moments(lit(film.scene, camera))[0] - pixel).max() < 0.02


def fixed(ends: Array) -> Callable[[Array], Array]:
    return lambda times: np.broadcast_to(ends, (len(times), *ends.shape))


@pytest.mark.parametrize(("depth", "share"), [(0.6, 0.0), (0.9, 1.0)])
def test_a_rod_hides_what_is_behind_it(depth: float, share: float) -> None:
    place = np.array([0.0, 0.0, 0.8])
    rod = Rod(fixed(np.array([[-0.2, 0.0, depth], [0.2, 0.0, depth]])), 0.012, albedo=0.0)
    film = film_of(one(place, rods=(rod,)))
    light = film.light_of(CAMERA, 0)
    assert light is not None
    assert light.sum() == pytest.approx(share * lit(one(place), over=4).sum())
    assert truth_of(film).visible[0, 0, 0] == share


def test_a_rod_over_half_a_marker_hides_half_its_light() -> None:
    place = np.array([0.0, 0.0, 0.8])
    rod = Rod(fixed(np.array([[-0.2, 0.03, 0.8 - 1e-3], [0.2, 0.03, 0.8 - 1e-3]])), 0.03, albedo=0.0)
    film = film_of(one(place, size=0.02, rods=(rod,)))
    light = film.light_of(CAMERA, 0)
    assert light is not None
    assert light.sum() == pytest.approx(lit(one(place, size=0.02)).sum() / 2, rel=0.05)
    assert 0.3 < truth_of(film).visible[0, 0, 0] < 0.7


def test_a_surface_hides_what_is_behind_it_but_not_what_is_on_it() -> None:
    place = np.array([0.0, 0.0, 0.8])
    for depth, visible in ((0.7, 0.0), (0.797, 1.0), (0.9, 1.0)):
        sheet = np.array([[-1.0, -1.0, depth], [1.0, -1.0, depth], [0.0, 2.0, depth]])
        surface = Surface(fixed(sheet), np.array([[0, 1, 2]]), albedo=0.0)
        film = film_of(one(place, surface=surface))
        light = film.light_of(CAMERA, 0)
        assert light is not None
        assert (light.max() > LEVEL / 2) == bool(visible)
        assert truth_of(film).visible[0, 0, 0] == visible


def test_a_marker_that_faces_away_is_dark() -> None:
    film = film_of(one(np.array([0.0, 0.0, 0.8]), axes=np.eye(3)))
    light = film.light_of(CAMERA, 0)
    assert light is not None
    assert not light.any()
    assert truth_of(film).visible[0, 0, 0] == 0.0


def test_a_marker_beyond_the_edge_is_cut() -> None:
    edge = np.array([(319.5 - 158.3) / FOCAL, 0.0, 1.0])
    film = film_of(one(edge, size=0.02))
    light = film.light_of(CAMERA, 0)
    assert light is not None
    assert light.sum() == pytest.approx(lit(one(np.array([0.1, 0.0, 1.0]), size=0.02)).sum() / 2, rel=0.03)
    assert 0.3 < truth_of(film).visible[0, 0, 0] < 0.7


def test_glare_is_bright_where_it_is() -> None:
    inside = Glare(0.5, 3.0, pixel=(200.0, 50.0))
    wanders = Glare(2.0, 4.0, path=lambda times: np.stack([0.05 + times, 0 * times, 1 + 0 * times], axis=1))
    light = lit(replace(one(np.array([0.0, 0.0, 1.0]), size=1e-6), glares=(inside, wanders)))
    assert light[50, 200] == pytest.approx(0.5 * LEVEL)
    assert light[50, 203] == pytest.approx(0.5 * LEVEL * np.exp(-0.5))
    y, x = np.unravel_index(light.argmax(), light.shape)
    assert (x, y) == tuple(np.rint(CAMERA.project([0.05 + CAMERA.exposure / 2, 0, 1])))


def test_the_corners_are_darker() -> None:
    shading = replace(CAMERA, sensor=Sensor(vignetting=0.2)).shading()
    assert shading[119:121, 159:161] == pytest.approx(np.ones((2, 2)), abs=1e-4)
    assert shading[0, 0] == pytest.approx(0.8, abs=3e-3)


def test_the_noise_has_its_variance() -> None:
    sensor = Sensor(gain=1.5, black=12.0, electrons=20.0, read=1.4, vignetting=0.0)
    readout = Readout(replace(CAMERA, sensor=sensor), (5,))
    for light in (0.0, 20.0, 100.0):
        images = np.stack([readout.read(frame, np.full((240, 320), light)) for frame in range(4)]).astype(float)
        level = 1.5 * light
        assert images.mean() == pytest.approx(12.0 + level, abs=0.03)
        assert images.var() == pytest.approx(level / 20.0 + 1.4**2 + 1 / 12, rel=0.02)


def test_frames_are_reproducible_in_any_order() -> None:
    camera = replace(CAMERA, sensor=Sensor())
    film, again = (film_of(one(np.array([0.0, 0.0, 1.0])), camera) for _ in range(2))
    later = film.frame(camera, 3)
    assert np.array_equal(list(again.images(camera))[3], later)
    assert not np.array_equal(film.frame(camera, 2), later)
    assert not np.array_equal(replace(film, seed=2).frame(camera, 3), later)


def test_corners_of_a_board_are_points_of_symmetry() -> None:
    board, z = Board(inner=(5, 4), side=0.02), 0.9
    corner = board.points()[7]
    centre = np.array([(170 - 158.3) / FOCAL * z, (110 - 121.6) / FOCAL * z, z]) - corner  # it is seen at (170, 110)
    image = board_light(CAMERA, board, BoardPose(centre, np.eye(3)), over=8)
    patch = image[102:119, 162:179]
    assert np.abs(patch - patch[::-1, ::-1]).max() < 0.5
    assert (patch[:5, :5].min(), patch[:5, -5:].max()) == pytest.approx(board.shades[:2][::-1], abs=0.5)
    aside = image[102:119, 163:180]
    assert np.abs(aside - aside[::-1, ::-1]).max() > 50


def test_the_wand_is_rigid() -> None:
    ends = Wand(length=0.25).scene().poses(np.linspace(0, 6, 50)).positions
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) == pytest.approx(np.full(50, 0.25))
    assert np.ptp(ends[:, 0], axis=0).min() > 0.1


def test_an_exposure_longer_than_a_frame_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"at most 0\.01 s"):
        replace(CAMERA, exposure=0.011)
