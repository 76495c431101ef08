"""Area, mean chord and second moment of outlines whose closed forms are known, from every format."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tests.importers.planform.outlines import described, path, polygon, refused, svg, table
from wingfit.importers.planform import WingTemplate
from wingfit.records.array_types import Array

A, B = 100.0, 30.0  # half axes of the ellipse, mm
K = 0.5522847498307936  # control points of the cubic that approximates a quarter of a circle within 2.7e-4
ELLIPSES = {
    "element": f'<ellipse cx="{A}" cy="0" rx="{A}" ry="{B}"/>',
    "arcs": path(f"M0 0A{A} {B} 0 0 1 {2 * A} 0A{A} {B} 0 0 1 0 0Z"),
    "relative arcs, flags without spaces": path(f"m0 0a{A} {B} 0 01{2 * A} 0a{A} {B} 0 01-{2 * A} 0z"),
    "turned circle": f'<circle r="1" transform="translate({A} 0) rotate(90) scale({B} {A})"/>',
    "cubics": path(
        f"M0 0C0 {-K * B} {A - K * A} {-B} {A} {-B}S{2 * A} {-K * B} {2 * A} 0 {A + K * A} {B} {A} {B}S0 {K * B} 0 0Z"
    ),
    "nested groups": '<g transform="scale(2)"><g transform="matrix(.5 0 0 .5 10 20)">'
    f'<ellipse cx="{A}" cy="0" rx="{A}" ry="{B}"/></g></g>',
}


def check(found: WingTemplate, area_mm2: float, span_mm: float, r2: float) -> None:
    sizes = found.measures
    assert math.isclose(sizes.area_m2, area_mm2 * 1e-6, rel_tol=1e-3)
    assert math.isclose(found.outline_area_m2, area_mm2 * 1e-6, rel_tol=3e-4)
    assert math.isclose(sizes.span_m, span_mm * 1e-3, rel_tol=1e-6)
    assert math.isclose(sizes.mean_chord_m, area_mm2 / span_mm * 1e-3, rel_tol=1e-3)
    assert math.isclose(sizes.aspect_ratio, span_mm**2 / area_mm2, rel_tol=1e-3)
    assert math.isclose(sizes.second_moment_radius, r2, rel_tol=1e-3)


@pytest.mark.parametrize("drawing", ELLIPSES.values(), ids=ELLIPSES.keys())
def test_an_ellipse(tmp_path: Path, drawing: str) -> None:
    found = described(tmp_path, svg(drawing))
    check(found, math.pi * A * B, 2 * A, math.sqrt(1.25) / 2)
    y, le, te = (one * 1e3 for one in (found.sections.y, found.sections.leading, found.sections.trailing))
    half = B * np.sqrt(np.maximum(0, 1 - (y / A - 1) ** 2))
    inner = (y > 5) & (y < 195)
    assert np.abs(te[inner] - half[inner]).max() < 0.03
    assert np.abs(le[inner] + half[inner]).max() < 0.03


@pytest.mark.parametrize("accuracy", [1e-4, 1e-3, 1e-2])
def test_the_accuracy_is_kept_with_fewer_stations_for_a_larger_one(tmp_path: Path, accuracy: float) -> None:
    found = described(tmp_path, svg(ELLIPSES["element"]), accuracy=accuracy)
    assert abs(found.measures.area_m2 / found.outline_area_m2 - 1) < accuracy
    assert found.sections.y.size < {1e-4: 300, 1e-3: 100, 1e-2: 32}[accuracy]
    fine = np.linspace(0, 2 * A, 4001)[2:-2]  # the least chord of a dataset widens the ends
    half = B * np.sqrt(np.maximum(0, 1 - (fine / A - 1) ** 2))
    edge = np.interp(fine, found.sections.y * 1e3, found.sections.trailing * 1e3)
    slope = np.gradient(edge, fine)
    assert (np.abs(edge - half) / np.hypot(1, slope)).max() < 1.2 * found.sections.tolerance * 1e3


def test_a_rectangle_has_two_stations(tmp_path: Path) -> None:
    found = described(tmp_path, svg(polygon((10, 5), (130, 5), (130, 45), (10, 45))))
    check(found, 120 * 40, 120, 1 / math.sqrt(3))
    assert found.sections.y.tolist() == [0, 0.12]
    assert found.sections.leading.tolist() == [0, 0]
    assert found.sections.chord.tolist() == [0.04, 0.04]


def test_a_triangle(tmp_path: Path) -> None:
    found = described(tmp_path, svg(path("M0,0 h0 L200 60 V60 L0 60 Z")))
    check(found, 0.5 * 200 * 60, 200, 1 / math.sqrt(6))
    assert len(found.sections.y) == 3  # one where the chord has become the least of a dataset


def test_a_step_of_the_chord_is_kept(tmp_path: Path) -> None:
    found = described(tmp_path, svg(polygon((0, 0), (100, 0), (100, 20), (50, 20), (50, 40), (0, 40))))
    assert math.isclose(found.measures.area_m2, 3000e-6, rel_tol=1e-3)
    assert np.allclose(np.interp([0.049, 0.051], found.sections.y, found.sections.chord), [0.04, 0.02], atol=1e-6)


@pytest.mark.parametrize("hinge_mm", [20.0, -10.0])
def test_the_flapping_axis_lies_where_it_is_stated(tmp_path: Path, hinge_mm: float) -> None:
    found = described(tmp_path, svg(polygon((0, 0), (90, 0), (90, 10), (0, 10))), hinge_mm=hinge_mm)
    assert math.isclose(found.hinge[0], -hinge_mm * 1e-3)
    r0, r1 = hinge_mm, hinge_mm + 90
    assert math.isclose(found.measures.second_moment_radius_m * 1e3, math.sqrt((r1**3 - r0**3) / 3 / 90), rel_tol=1e-9)


def corners(*, root: str, leading: str) -> list[tuple[float, float]]:
    """A swept wing, root chord 40 and tip chord 10, whose root and leading edge lie on the given sides."""
    wing = np.array([(0.0, 0.0), (100.0, 15.0), (100.0, 25.0), (0.0, 40.0)])  # (out, aft)
    axes = {"low-x": (0, 1), "high-x": (0, -1), "low-y": (1, 1), "high-y": (1, -1)}
    points = np.zeros((4, 2))
    for (axis, sign), column in ((axes[root], 0), (axes[leading], 1)):
        points[:, axis] = 7 + sign * wing[:, column]
    return [(float(x), float(y)) for x, y in points]


@pytest.mark.parametrize(
    ("root", "leading"), [("low-x", "high-y"), ("high-x", "low-y"), ("low-y", "low-x"), ("high-y", "high-x")]
)
def test_every_orientation_gives_the_same_wing(tmp_path: Path, root: str, leading: str) -> None:
    points = corners(root=root, leading=leading)
    found = described(tmp_path, table(*points), "wing.csv", root=root, leading_edge=leading)
    assert np.allclose(found.sections.leading, [0, 0.015])
    assert np.allclose(found.sections.chord, [0.04, 0.01])
    words = {"low-x": "left", "high-x": "right", "low-y": "top", "high-y": "bottom"}  # y points down in an SVG
    drawn = described(tmp_path, svg(polygon(*points)), root=words[root], leading_edge=words[leading])
    assert np.allclose(drawn.sections.leading, found.sections.leading)


def test_scales_agree(tmp_path: Path) -> None:
    points = [(0, 0), (80, 0), (80, 20), (0, 20)]
    page = svg(polygon(*points), attributes='width="160mm" height="80mm" viewBox="0 0 80 40"')
    areas = [
        described(tmp_path, page, unit="page").measures.area_m2,
        described(tmp_path, page, unit=None, mm_per_unit=2.0).measures.area_m2,
        described(tmp_path, page, unit=None, span_mm=160.0).measures.area_m2,
        described(tmp_path, table(*points, header="x_cm,y_cm"), "w.csv", unit=None).measures.area_m2 * 0.04,
        described(tmp_path, table(*points), "w.csv", unit="in").measures.area_m2 * (2 / 25.4) ** 2,
    ]
    assert np.allclose(areas, 160 * 40e-6, rtol=1e-9)


def test_stations_are_a_format(tmp_path: Path) -> None:
    text = "span_mm,leading_edge_mm,trailing_edge_mm\n10,5,45\n60,15,45\n110,35,45\n"
    found = described(tmp_path, text, "s.csv", unit=None, root="low-y", leading_edge=None)
    assert np.allclose(found.sections.y, [0, 0.05, 0.1])
    assert np.allclose(found.sections.leading, [0, 0.01, 0.03])
    assert np.allclose(found.sections.chord, [0.04, 0.03, 0.01])
    chords = "span,leading_edge,chord\n10,5,40\n60,15,30\n110,35,10\n"
    same = described(tmp_path, chords, "c.csv", root="low-y", leading_edge=None)
    assert np.allclose(same.sections.chord, found.sections.chord)
    forward = "span;le;te\n10;45;5\n60;35;5\n110;15;5\n"  # x points to the nose
    mirrored = described(tmp_path, forward, "f.csv", root="low-y", leading_edge=None)
    assert np.allclose(mirrored.sections.leading, found.sections.leading)


def test_a_planform_photo_that_was_digitised(tmp_path: Path) -> None:
    source = Path(__file__).parents[4] / "shared" / "data" / "yeo2011" / "extracted_planform_coordinates.csv"
    if not source.exists():
        pytest.skip("the recordings of Yeo et al. 2011 are not here")
    text = source.read_text()
    assert "give --close" in refused(tmp_path, text, "yeo.csv")
    found = described(tmp_path, text, "yeo.csv", close=True)
    points = np.array([line.split(",") for line in text.split()], dtype=np.float64)
    assert math.isclose(found.measures.area_m2 * 1e6, _shoelace(points), rel_tol=1e-3)
    assert math.isclose(found.measures.span_m * 1e3, np.ptp(points[:, 0]), rel_tol=1e-6)


def _shoelace(points: Array) -> float:
    ring = [*points.tolist(), points[0].tolist()]
    return float(abs(sum(a[0] * b[1] - a[1] * b[0] for a, b in pairwise(ring)))) / 2
