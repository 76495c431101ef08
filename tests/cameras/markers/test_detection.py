"""Chequers and dots found in images drawn here: how near to the truth, and how near they claim to be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from tests.cameras.markers.drawing import Inside, Mark, affine, chequer, disc, drawn, lattice, noisy
from wingfit.cameras.markers.chequer import detect_chequers
from wingfit.cameras.markers.detections import Detections, no_detections
from wingfit.cameras.markers.dot import detect_dots
from wingfit.records.array_types import Array, Index

DARK = 10.0
Detect = Callable[[Array, float, float], Detections]


@dataclass(frozen=True)
class Kind:
    inside: Inside
    detect: Detect


KINDS = {"chequer": Kind(chequer, detect_chequers), "dot": Kind(disc, detect_dots)}
both = pytest.mark.parametrize("kind", list(KINDS))


def image_of(kind: str, size: float, blur: float, noise: float, count: int = 49, seed: int = 1) -> tuple[Array, Array]:
    """An image with many markers of affine shapes, and their places."""
    rng = np.random.default_rng(seed)
    area, places = lattice(rng, count, 3 * size + 8)
    marks = [(KINDS[kind].inside, place, affine(rng, size)) for place in places]
    return noisy(drawn(area, marks, blur), noise, rng), places


def matched(found: Detections, places: Array) -> tuple[Array, Index, Detections]:
    """Errors [N, 2] of the detections within a pixel of a place, the places [N] that they are, and they themselves."""
    apart = np.linalg.norm(places[:, None] - found.pixels[None], axis=2)
    index = apart.argmin(1)
    good = np.flatnonzero(apart.min(1) < 1)
    return found.pixels[index[good]] - places[good], good, found.only(index[good])


@pytest.mark.parametrize(
    ("kind", "size", "blur", "noise", "most"),
    [
        ("chequer", 12.0, 0.6, 1.0, 0.012),
        ("chequer", 12.0, 1.2, 4.0, 0.03),
        ("chequer", 7.0, 0.6, 1.0, 0.02),
        ("chequer", 7.0, 1.2, 4.0, 0.06),
        ("chequer", 4.0, 0.6, 2.0, 0.06),
        ("dot", 7.0, 0.6, 1.0, 0.008),
        ("dot", 7.0, 1.2, 4.0, 0.025),
        ("dot", 4.0, 0.6, 1.0, 0.01),
        ("dot", 4.0, 1.2, 4.0, 0.04),
    ],
)
def test_markers_are_found_within_parts_of_a_pixel(
    kind: str, size: float, blur: float, noise: float, most: float
) -> None:
    image, places = image_of(kind, size, blur, noise)
    found = KINDS[kind].detect(image, DARK, noise)
    errors, good, near = matched(found, places)
    assert len(good) >= 47
    assert len(found) == len(good)  # nothing else
    assert np.sqrt((errors**2).mean()) < most
    # At a right angle the brightness is that of the marker: 140 above the dark, less what a slant and blur take.
    assert np.median(near.contrast) == pytest.approx(140.0, rel=0.1)
    assert (near.size_px < 1.6 * size).all()
    assert np.median(near.size_px) > 0.4 * size


@pytest.mark.parametrize(
    ("kind", "size", "blur", "noise"),
    [("chequer", 4.5, 1.2, 4.0), ("chequer", 7.0, 0.8, 6.0), ("dot", 4.0, 1.0, 6.0), ("dot", 6.0, 0.7, 8.0)],
)
def test_the_covariance_covers_the_errors(kind: str, size: float, blur: float, noise: float) -> None:
    """Where noise is all that disturbs, errors in deviations are between 0.5 and 1.35, and few are large."""
    distances = []
    for seed in range(3):
        image, places = image_of(kind, size, blur, noise, seed=seed)
        errors, _, near = matched(KINDS[kind].detect(image, DARK, noise), places)
        distances.append(np.einsum("ni,nij,nj->n", errors, np.linalg.inv(near.covariance), errors))
    squared = np.concatenate(distances)
    assert len(squared) > 130
    assert 0.5**2 < squared.mean() / 2 < 1.35**2
    assert (squared < 5.99).mean() > 0.88  # 95 % of a chi-square with two degrees of freedom


@both
@pytest.mark.parametrize("noise", [1.0, 3.0, 12.0])
def test_noise_is_no_marker(kind: str, noise: float) -> None:
    rng = np.random.default_rng(int(noise))
    image = noisy(np.full((480, 640), 40.0), noise, rng)
    assert len(KINDS[kind].detect(image, 40.0, noise)) == 0


@both
@pytest.mark.parametrize("level", [0, 255])
def test_an_image_of_one_level_has_no_marker(kind: str, level: int) -> None:
    assert len(KINDS[kind].detect(np.full((90, 120), level, np.uint8), float(level), 1.0)) == 0


def test_edges_and_stripes_are_no_chequers() -> None:
    rng = np.random.default_rng(6)
    y, x = np.mgrid[:200, :300].astype(float)
    for angle in (0.0, 0.3, 0.8, np.pi / 2):
        stripes = 60 + 100 * (np.sin(0.35 * (np.cos(angle) * x + np.sin(angle) * y)) > 0)
        assert len(detect_chequers(noisy(stripes, 1.0, rng), 60.0, 1.0)) == 0


@both
def test_a_marker_cut_by_the_border_is_not_displaced(kind: str) -> None:
    """It is found where it is or not at all; a whole one beside the border is found."""
    size, errors, whole = 8.0, [], []
    for distance in np.arange(-6.0, 12.0):
        rng = np.random.default_rng([7, int(distance + 6)])
        place = np.array([distance, 30.0]) + rng.uniform(-0.5, 0.5, 2)
        turned = place if distance % 2 else np.array([79.0, 59.0]) - place  # the right border in half of the cases
        mark = (KINDS[kind].inside, turned, affine(rng, size))
        found = KINDS[kind].detect(noisy(drawn((80, 60), [mark]), 1.0, rng), DARK, 1.0)
        near = found.pixels - turned
        errors += list(np.einsum("ni,nij,nj->n", near, np.linalg.inv(found.covariance), near))
        whole += [len(found)] * bool(distance > 9)
    assert set(whole) == {1}
    assert len(errors) > 6
    assert max(errors) < 30  # in squared deviations; a few hundred if the image were continued beyond its border


@both
def test_saturated_markers_are_found(kind: str) -> None:
    rng = np.random.default_rng(8)
    area, places = lattice(rng, 16, 40.0)
    marks = [(KINDS[kind].inside, place, affine(rng, 10.0)) for place in places]
    image = noisy(drawn(area, marks, 0.7, (10.0, 400.0)), 1.5, rng)
    assert (image == 255).sum() > 100
    errors, good, _ = matched(KINDS[kind].detect(image, DARK, 1.5), places)
    assert len(good) == 16
    assert np.abs(errors).max() < 0.3


@both
def test_markers_on_uneven_ground_are_found(kind: str) -> None:
    """Light that falls across the image by a factor of three."""
    image, places = image_of(kind, 8.0, 0.7, 0.0, 25)
    fall = np.linspace(1.0, 0.35, image.shape[1])
    uneven = noisy(image * fall, 1.0, np.random.default_rng(2))
    errors, good, _ = matched(KINDS[kind].detect(uneven, DARK, 1.0), places)
    assert len(good) == 25
    assert np.sqrt((errors**2).mean()) < 0.06


@both
@pytest.mark.parametrize(("radius", "halo"), [(4.0, 0.7), (70.0, 0.7), (60.0, 15.0)], ids=["point", "disc", "glow"])
def test_a_lamp_in_the_picture_hides_only_what_is_beside_it(kind: str, radius: float, halo: float) -> None:
    """Markers 35 grey levels above the ground, and a lamp that saturates: all that are 70 px from it are found."""
    rng = np.random.default_rng(8)
    size, places = lattice(rng, 64, 55.0)
    lamp = np.array([150.0, 260.0])
    marks: list[Mark] = [(KINDS[kind].inside, at, 6.0 * np.eye(2)) for at in places]
    image = drawn(size, marks, levels=(12.0, 47.0))
    image += drawn(size, [(disc, lamp, radius * np.eye(2))], blur=halo, levels=(0.0, 900.0))
    found = KINDS[kind].detect(noisy(image, 1.0, rng), 12.0, 1.0)
    away = np.linalg.norm(places - lamp, axis=1) > radius + 3 * halo + 70
    assert away.sum() > 20
    apart = np.linalg.norm(places[away][:, None] - found.pixels[None], axis=2).min(1)
    assert apart.max() < 0.2


def test_detections_are_selected_together() -> None:
    image, _ = image_of("dot", 5.0, 0.7, 1.0, 9)
    found = detect_dots(image, DARK, 1.0)
    some = found.only(np.array([2, 0]))
    assert np.array_equal(some.pixels, found.pixels[[2, 0]])
    assert np.array_equal(some.covariance, found.covariance[[2, 0]])
    assert len(some) == 2
    assert len(no_detections()) == 0
