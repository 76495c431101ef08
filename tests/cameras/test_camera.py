"""One camera: pixels, their derivatives, and the rays of pixels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.cameras.calibrate.simulated import LENSES, ring
from wingfit.cameras.camera import COEFFICIENTS, FOCAL_AND_CENTRE, POSE, Camera, Lens, LensModel
from wingfit.records.array_types import Array
from wingfit.records.errors import DatasetError

RNG = np.random.default_rng(5)
POINTS = RNG.uniform(-0.12, 0.12, (25, 3)) + np.array([0, 0, 0.6])
MODELS = list(LENSES)


def camera(model: LensModel) -> Camera:
    return ring((0.0, 25.0), model)[1]


def changed(one: Camera, name: str, step: float) -> Camera:
    """The camera with one parameter changed, as the documentation of ``project_with_changes`` defines it."""
    if name in FOCAL_AND_CENTRE:
        matrix = one.matrix.copy()
        matrix[("f_x", "f_y", "c_x", "c_y").index(name) % 2, 0 if name == "f_x" else 1 if name == "f_y" else 2] += step
        return replace(one, matrix=matrix)
    if name in POSE:
        axis = np.eye(3)["xyz".index(name[-1])]
        if name.startswith("move"):
            return replace(one, translation=one.translation + step * axis)
        return replace(one, rotation=Rotation.from_rotvec(step * axis).as_matrix() @ one.rotation)
    index = COEFFICIENTS[one.lens.model].index(name)
    coefficients = np.array(one.lens.coefficients) + step * np.eye(len(one.lens.coefficients))[index]
    return replace(one, lens=Lens(one.lens.model, tuple(coefficients)))


@pytest.mark.parametrize("model", MODELS)
def test_derivatives_by_points_are_finite_differences(model: LensModel) -> None:
    one, step = camera(model), 1e-6
    pixels, by_point, _ = one.project_with_changes(POINTS)
    expected = [(one.project(POINTS + move) - one.project(POINTS - move)) / (2 * step) for move in step * np.eye(3)]
    assert by_point == pytest.approx(np.stack(expected, axis=2), abs=1e-5)
    assert np.array_equal(pixels, one.project(POINTS))


@pytest.mark.parametrize("model", MODELS)
def test_derivatives_by_parameters_are_finite_differences(model: LensModel) -> None:
    one, step = camera(model), 1e-6
    by_parameter = one.project_with_changes(POINTS)[2]
    assert by_parameter.shape == (len(POINTS), 2, len(one.parameter_names))
    for name, found in zip(one.parameter_names, np.moveaxis(by_parameter, 2, 0), strict=True):
        up, down = (changed(one, name, sign * step).project(POINTS) for sign in (1, -1))
        assert found == pytest.approx((up - down) / (2 * step), rel=1e-6, abs=1e-5), name


@pytest.mark.parametrize("model", MODELS)
def test_a_ray_leads_to_the_point_that_was_seen(model: LensModel) -> None:
    one = camera(model)
    inside = one.rotation @ POINTS.T + one.translation[:, None]
    assert one.rays(one.project(POINTS)) == pytest.approx((inside[:2] / inside[2]).T, abs=1e-9)
    assert one.depth(POINTS) == pytest.approx(inside[2])


def test_a_pinhole_is_a_division_by_the_depth() -> None:
    one = camera("pinhole")
    x, y, z = one.rotation @ POINTS.T + one.translation[:, None]
    (f, _, u), (_, g, v), _ = one.matrix
    assert one.project(POINTS) == pytest.approx(np.column_stack([u + f * x / z, v + g * y / z]), abs=1e-9)


def test_the_centre_has_no_depth_and_all_rays_pass_it() -> None:
    one = camera("brown")
    assert one.depth(one.centre[None]) == pytest.approx([0], abs=1e-12)
    assert one.rotation @ one.centre + one.translation == pytest.approx(np.zeros(3), abs=1e-12)
    behind = 2 * one.centre - POINTS
    assert (one.depth(behind) < 0).all()


@pytest.mark.parametrize("model", MODELS)
def test_no_points_have_no_pixels(model: LensModel) -> None:
    one, nothing = camera(model), np.empty((0, 3))
    shapes = [part.shape for part in one.project_with_changes(nothing)]
    assert shapes == [(0, 2), (0, 2, 3), (0, 2, len(one.parameter_names))]
    assert one.rays(np.empty((0, 2))).shape == (0, 2)


@pytest.mark.parametrize(
    ("model", "coefficients", "words"),
    [
        ("browm", (0.0,) * 5, ["browm", "no model", "'brown'"]),
        ("brown", (0.1, 0.2), ["2", "k1, k2, p1, p2, k3"]),
        ("fisheye", (0.1,) * 5, ["5", "k1, k2, k3, k4"]),
        ("pinhole", (0.1,), ["1", "none"]),
    ],
)
def test_a_lens_that_cannot_be_is_refused(model: LensModel, coefficients: tuple[float, ...], words: list[str]) -> None:
    with pytest.raises(DatasetError) as refused:
        Lens(model, coefficients)
    assert all(word in str(refused.value) for word in words), str(refused.value)


def test_columns_of_the_derivatives_have_names_of_their_own() -> None:
    def names(model: LensModel) -> Array:
        return np.array(camera(model).parameter_names)

    for model in MODELS:
        assert len(set(names(model))) == len(names(model)) == 10 + len(LENSES[model])
