"""The data of an SVG path: lines, cubic and quadratic Bézier curves and elliptical arcs as points (SVG 1.1, section 8).

Curves are flattened: a line through n equal steps of the parameter deviates from a curve B(t) by at most
max|B''| / (8 n^2), which gives n for the tolerance.
"""

from __future__ import annotations

import cmath
import math
import re
from collections.abc import Iterator

import numpy as np

from wingfit.importers.planform.shapes import FLATTENING, LARGEST
from wingfit.records.array_types import Array
from wingfit.records.errors import shown

_NUMBER = re.compile(r"[\s,]*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]{1,3})?)")
_FLAG = re.compile(r"[\s,]*([01])")
_COMMAND = re.compile(r"[\s,]*([MmZzLlHhVvCcSsQqTtAa])")
_COUNT = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}
_ARC_STEP = 2 * math.acos(1 - FLATTENING)  # rad; the sagitta of a step is the tolerance times the radius


def subpaths(data: str) -> list[tuple[Array, bool]]:
    """Return the parts of a path as points [N, 2] and whether each is closed; ValueError says what cannot be read."""
    return _Pen().draw(data)


class _Pen:
    """Follows the commands of a path; points are complex numbers."""

    def __init__(self) -> None:
        self.parts: list[tuple[list[complex], bool]] = []
        self.here = self.start = self.control = 0j
        self.before = ""

    def draw(self, data: str) -> list[tuple[Array, bool]]:
        for command, numbers in _commands(data):
            kind, offset = command.upper(), self.here if command.islower() else 0j
            if not self.before and kind != "M":
                raise ValueError(f"starts with {command!r}; a path starts with M")
            if kind == "M":
                self.here = self.start = offset + complex(*numbers)
                self.parts.append(([self.here], False))
            elif kind == "Z":
                self.parts[-1] = (self.parts[-1][0], True)
                self.here = self.start
            else:
                if self.before == "Z":
                    self.parts.append(([self.start], False))
                self._segment(kind, numbers, offset)
            self.before = kind
        found = [(np.array([[p.real, p.imag] for p in points]), closed) for points, closed in self.parts]
        return [(points, closed) for points, closed in found if len(points) > 1]

    def _segment(self, kind: str, numbers: list[float], offset: complex) -> None:
        if kind == "A":
            self._add(_arc(self.here, numbers, offset + complex(*numbers[5:])))
            return
        if kind in "HV":
            x, y = (offset.real, self.here.imag) if kind == "H" else (self.here.real, offset.imag)
            self._add([complex(x + numbers[0], y) if kind == "H" else complex(x, y + numbers[0])])
            return
        points = [offset + complex(*numbers[k : k + 2]) for k in range(0, len(numbers), 2)]
        if kind in "ST":  # the first control point mirrors the last one of the curve before
            same = self.before in ("CS" if kind == "S" else "QT")
            points.insert(0, 2 * self.here - self.control if same else self.here)
        if kind in "CSQT":
            self.control = points[-2]
        self._add(points if kind == "L" else _bezier([self.here, *points]))

    def _add(self, points: list[complex]) -> None:
        self.parts[-1][0].extend(points)
        self.here = points[-1]


def _commands(data: str) -> Iterator[tuple[str, list[float]]]:
    """Yield each command with its numbers; repeated numbers repeat the command, and further ones of M are L."""
    at, command = 0, ""
    data = data.strip()
    while at < len(data):
        if match := _COMMAND.match(data, at):
            command, at = match[1], match.end()
        elif command in ("", "Z", "z"):
            raise ValueError(f"has {data[at : at + 10]!r} where a command such as M or L is expected")
        numbers = []
        for index in range(_COUNT[command.upper()]):
            match = (_FLAG if command in "Aa" and index in (3, 4) else _NUMBER).match(data, at)
            if match is None:
                raise ValueError(f"has {data[at : at + 10]!r} where a number of the command {command} is expected")
            numbers.append(float(match[1]))
            if abs(numbers[-1]) > LARGEST:
                raise ValueError(
                    f"has the number {shown(match[1])}; numbers up to {LARGEST:g} are read: scale the drawing"
                )
            at = match.end()
        yield command, numbers
        command = {"M": "L", "m": "l"}.get(command, command)


def _bezier(points: list[complex]) -> list[complex]:
    """Return the points of a Bézier curve of degree 2 or 3, without its first one."""
    degree = len(points) - 1
    second = degree * (degree - 1) * max(abs(points[k] - 2 * points[k + 1] + points[k + 2]) for k in range(degree - 1))
    size = max(abs(a - b) for a in points for b in points)
    steps = max(1, math.ceil(math.sqrt(second / (8 * FLATTENING * size)))) if size else 1
    t = np.arange(1, steps + 1) / steps
    weights = [math.comb(degree, k) * t**k * (1 - t) ** (degree - k) for k in range(degree + 1)]
    curve = sum(w * p for w, p in zip(weights, points, strict=True))
    return [*np.asarray(curve).tolist()[:-1], points[-1]]


def _arc(start: complex, numbers: list[float], end: complex) -> list[complex]:
    """Return the points of an elliptical arc, without its first one; SVG 1.1, F.6.5 and F.6.6."""
    rx, ry, turn = abs(numbers[0]), abs(numbers[1]), cmath.exp(1j * math.radians(numbers[2]))
    if start == end or not (rx and ry):
        return [end]
    half = (start - end) / 2 / turn
    x, y = half.real, half.imag
    excess = (x / rx) ** 2 + (y / ry) ** 2
    if excess > 1:
        rx, ry = rx * math.sqrt(excess), ry * math.sqrt(excess)
    rest = max(0.0, 1 / ((x / rx) ** 2 + (y / ry) ** 2) - 1)
    sign = -1 if bool(numbers[3]) == bool(numbers[4]) else 1
    centre = sign * math.sqrt(rest) * complex(rx * y / ry, -ry * x / rx)
    first = math.atan2((y - centre.imag) / ry, (x - centre.real) / rx)
    last = math.atan2((-y - centre.imag) / ry, (-x - centre.real) / rx)
    sweep = (last - first) % (2 * math.pi) - (0 if numbers[4] else 2 * math.pi)
    steps = max(1, math.ceil(abs(sweep) / _ARC_STEP))
    angles = first + sweep * np.arange(1, steps + 1) / steps
    local = rx * np.cos(angles) + 1j * ry * np.sin(angles) + centre
    curve = local * turn + (start + end) / 2
    return [*curve.tolist()[:-1], end]
