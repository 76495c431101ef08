"""Outlines in DXF drawings; skipped without the optional library ezdxf."""

from __future__ import annotations

import math
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

from tests.importers.planform.outlines import described, refused

ezdxf: Any = pytest.importorskip("ezdxf")


def dxf(draw: Callable[[Any], object], units: int = 0) -> str:
    document, text = ezdxf.new(), StringIO()
    document.header["$INSUNITS"] = units
    draw(document.modelspace())
    document.write(text)
    return text.getvalue()


def d_shape(space: Any) -> None:
    """A rectangle of 100 x 40 with half a circle at its tip; pieces in mixed order and directions."""
    space.add_line((0, -20), (0, 20))
    space.add_arc((100, 0), 20, -90, 90)
    space.add_line((100, 20), (0, 20))
    space.add_line((0, -20), (100, -20))


def test_a_chain_of_lines_and_an_arc(tmp_path: Path) -> None:
    found = described(tmp_path, dxf(d_shape, units=4), "wing.dxf", unit=None)
    assert math.isclose(found.measures.area_m2 * 1e6, 4000 + 200 * math.pi, rel_tol=1e-3)
    assert ("scale", "mm", "file") in [(fact.fact, fact.value, fact.by) for fact in found.facts]


def test_polylines_with_bulges_and_closed_splines(tmp_path: Path) -> None:
    bulged = dxf(
        lambda space: space.add_lwpolyline([(0, 0, 0), (60, 0, 1), (60, 20, 0), (0, 20, 0)], "xyb", close=True)
    )
    found = described(tmp_path, bulged, "wing.dxf")
    assert math.isclose(found.measures.area_m2 * 1e6, 60 * 20 + math.pi * 50, rel_tol=1e-3)
    ellipse = dxf(lambda space: space.add_ellipse((50, 0), (50, 0), 0.3))
    assert math.isclose(described(tmp_path, ellipse, "e.dxf").measures.area_m2 * 1e6, math.pi * 50 * 15, rel_tol=1e-3)


def test_what_is_refused(tmp_path: Path) -> None:
    assert "but the file states in" in refused(tmp_path, dxf(d_shape, units=1), "wing.dxf", unit="mm")
    half = dxf(lambda space: space.add_line((0, 0), (60, 0)) and space.add_line((60, 0), (60, 20)))
    assert "close it" in refused(tmp_path, half, "wing.dxf")
    tilted = dxf(lambda space: space.add_polyline3d([(0, 0, 0), (60, 0, 5), (60, 20, 0)], close=True))
    assert "not flat" in refused(tmp_path, tilted, "wing.dxf")
    assert "no DXF that can be read" in refused(tmp_path, "0\nSECTION\nrubbish", "wing.dxf")
