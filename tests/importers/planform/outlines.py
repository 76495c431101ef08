"""Outlines of known shape as text of files, and short ways to describe and to catch what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from wingfit.importers.planform import WingTemplate, wing_template
from wingfit.records import DatasetError

LEFT_TOP = {"root": "left", "leading_edge": "top", "unit": "mm", "hinge_mm": 0.0}
LOW_HIGH = {"root": "low-x", "leading_edge": "high-y", "unit": "mm", "hinge_mm": 0.0}


def svg(*elements: str, attributes: str = "") -> str:
    return f'<svg xmlns="http://www.w3.org/2000/svg" {attributes}>{"".join(elements)}</svg>'


def path(data: str, name: str = "wing", more: str = "") -> str:
    return f'<path id="{name}" d="{data}" {more}/>'


def polygon(*points: tuple[float, float]) -> str:
    return f'<polygon points="{" ".join(f"{x},{y}" for x, y in points)}"/>'


def table(*points: tuple[float, float], header: str = "x,y") -> str:
    return "\n".join([header, *(f"{x},{y}" for x, y in points)]) + "\n"


def described(folder: Path, content: str | bytes, file: str = "wing.svg", **options: Any) -> WingTemplate:
    """Describe the wing in ``content``; by default an SVG with the root left, the leading edge on top, in mm."""
    place = folder / file
    place.write_bytes(content.encode() if isinstance(content, str) else content)
    standard = LEFT_TOP if file.endswith((".svg", ".dxf")) else LOW_HIGH
    return wing_template(place, **{**standard, **options})


def refused(folder: Path, content: str | bytes, file: str = "wing.svg", **options: Any) -> str:
    """Return the message with which ``content`` is refused; every fault has a place and a message."""
    with pytest.raises(DatasetError) as caught:
        described(folder, content, file, **options)
    assert all(fault.where and fault.message for fault in caught.value.errors)
    return str(caught.value)
