"""Rendered films of a flapping wing, tracked with the true cameras, against the truth of the renderer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.cameras.renderer.film import Film as RenderedFilm
from benchmarks.cameras.renderer.film_camera import FilmCamera
from benchmarks.cameras.renderer.presets import thesis_strobe
from benchmarks.cameras.renderer.truth import truth_of
from benchmarks.cameras.write import write_video
from wingfit.cameras.camera import Camera, Lens
from wingfit.cameras.track.procedure import Request, track
from wingfit.cameras.video.source import Film


def true_camera(of: FilmCamera) -> Camera:
    lens = Lens("brown", tuple(float(one) for one in of.distortion))
    return Camera(of.name, of.size, of.matrix, lens, of.rotation, of.translation, of.row_time)


def written(film: RenderedFilm, folder: Path) -> tuple[Film, ...]:
    for camera in film.cameras:
        write_video(folder / f"{camera.name}.mkv", film.images(camera), camera.size, camera.rate)
    return tuple(Film(folder / f"{camera.name}.mkv", camera.rate) for camera in film.cameras)


def test_the_markers_of_a_wing_under_a_strobe_are_tracked(tmp_path: Path) -> None:
    film = thesis_strobe(scale=0.4, flashes=4, seed=5).film
    truth = truth_of(film)
    rest = film.scene.poses(np.zeros(1)).positions[0]
    films = written(film, tmp_path)
    cameras = tuple(true_camera(camera) for camera in film.cameras)
    found = track(Request(cameras, films, "chequer", "strobe", film.scene.names, rest))
    assert found.positions.shape == truth.positions.shape
    errors = np.linalg.norm(found.positions - truth.positions, axis=2)
    visible = (truth.visible > 0.99).all(0)
    assert found.found[visible].mean() > 0.97
    assert np.nanmedian(errors) < 3e-4
    assert np.nanmax(errors) < 5e-3  # neighbours are 2 cm apart: no label is wrong
    assert found.names == film.scene.names
    # Four flashes of which the markers hide the split give the period to a quarter of a frame.
    assert np.diff(found.times) == pytest.approx(np.diff(truth.times), abs=4e-3)
