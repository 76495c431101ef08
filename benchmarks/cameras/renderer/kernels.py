"""Compiled loops of the renderer: rays of pixels, samples of markers, occlusion, and the outline of the wing.

All are in this file, because numba's cache notices changes of the file of a compiled function only. Coordinates are
those of a camera: origin at its centre, x right, y down, z forward, m.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar, cast

import numba
import numpy as np

from wingfit.records.array_types import Array, Mask

F = TypeVar("F", bound=Callable[..., object])

CHEQUER, DOT, BALL = 0, 1, 2
_NEWTON_STEPS = 20
_NEAR = 1e-9  # of the unit of the coordinates on the plane z = 1, so about 1e-6 pixels


def compiled(function: F) -> F:
    """Compile ``function`` without any change of its arithmetic, and cache it."""
    return cast(F, numba.njit(cache=True, error_model="numpy", nogil=True)(function))


@compiled
def distorted(x: float, y: float, d: Array) -> tuple[float, float]:
    """Distort the point (x, y) of the plane z = 1 by the coefficients ``d`` = k1, k2, p1, p2, k3 (Brown 1966)."""
    rr = x * x + y * y
    radial = 1.0 + rr * (d[0] + rr * (d[1] + rr * d[4]))
    return (
        x * radial + 2.0 * d[2] * x * y + d[3] * (rr + 2.0 * x * x),
        y * radial + d[2] * (rr + 2.0 * y * y) + 2.0 * d[3] * x * y,
    )


@compiled
def undistorted(u: float, v: float, d: Array) -> tuple[float, float, bool]:
    """Invert :func:`distorted` by Newton's method; the third value is whether it converged."""
    x, y = u, v
    for _ in range(_NEWTON_STEPS):
        fu, fv = distorted(x, y, d)
        du, dv = fu - u, fv - v
        if du * du + dv * dv < _NEAR * _NEAR * 1e-6:
            return x, y, True
        rr = x * x + y * y
        radial = 1.0 + rr * (d[0] + rr * (d[1] + rr * d[4]))
        slope = 2.0 * (d[0] + rr * (2.0 * d[1] + 3.0 * rr * d[4]))  # derivative of radial by rr, doubled
        a = radial + slope * x * x + 2.0 * d[2] * y + 6.0 * d[3] * x
        b = slope * x * y + 2.0 * d[2] * x + 2.0 * d[3] * y
        c = radial + slope * y * y + 6.0 * d[2] * y + 2.0 * d[3] * x
        det = a * c - b * b
        if det <= 0.0:  # beyond the largest radius that the lens images
            return x, y, False
        x -= (c * du - b * dv) / det
        y -= (a * dv - b * du) / det
    fu, fv = distorted(x, y, d)
    return x, y, (fu - u) ** 2 + (fv - v) ** 2 < _NEAR * _NEAR


@compiled
def ray_table(width: int, height: int, pad: int, inverse: Array, d: Array) -> Array:
    """Points of the plane z = 1 that the pixel centres see; [height + 2 pad, width + 2 pad, 2], NaN where none.

    ``inverse``: inverse of the camera matrix [3, 3]; ``pad``: pixels beyond each edge.
    """
    table = np.empty((height + 2 * pad, width + 2 * pad, 2))
    for i in range(height + 2 * pad):
        for j in range(width + 2 * pad):
            px, py = float(j - pad), float(i - pad)
            u = inverse[0, 0] * px + inverse[0, 1] * py + inverse[0, 2]
            v = inverse[1, 1] * py + inverse[1, 2]
            x, y, found = undistorted(u, v, d)
            table[i, j, 0] = x if found else np.nan
            table[i, j, 1] = y if found else np.nan
    return table


@compiled
def _ray(table: Array, px: float, py: float) -> tuple[float, float]:
    """Interpolate the table of rays between pixel centres; NaN outside it."""
    i, j = math.floor(py), math.floor(px)
    if i < 0 or j < 0 or i + 1 >= table.shape[0] or j + 1 >= table.shape[1]:
        return np.nan, np.nan
    a, b = py - i, px - j
    x = (1 - a) * ((1 - b) * table[i, j, 0] + b * table[i, j + 1, 0]) + a * (
        (1 - b) * table[i + 1, j, 0] + b * table[i + 1, j + 1, 0]
    )
    y = (1 - a) * ((1 - b) * table[i, j, 1] + b * table[i, j + 1, 1]) + a * (
        (1 - b) * table[i + 1, j, 1] + b * table[i + 1, j + 1, 1]
    )
    return x, y


@compiled
def hides_triangle(x: float, y: float, depth: float, triangles: Array) -> bool:
    """Whether a triangle of [M, 3, 3] crosses the ray (x, y, 1) before z = ``depth``."""
    for m in range(len(triangles)):
        a, b, c = triangles[m, 0], triangles[m, 1], triangles[m, 2]
        if min(a[2], b[2], c[2]) > depth:
            continue
        e0, e1, e2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        f0, f1, f2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        h0, h1, h2 = y * f2 - f1, f0 - x * f2, x * f1 - y * f0
        det = e0 * h0 + e1 * h1 + e2 * h2
        if det == 0.0:
            continue
        p = -(a[0] * h0 + a[1] * h1 + a[2] * h2) / det
        if p < 0.0 or p > 1.0:
            continue
        q0, q1, q2 = -a[1] * e2 + a[2] * e1, -a[2] * e0 + a[0] * e2, -a[0] * e1 + a[1] * e0
        q = (x * q0 + y * q1 + q2) / det
        z = (f0 * q0 + f1 * q1 + f2 * q2) / det
        if q >= 0.0 and p + q <= 1.0 and 0.0 < z < depth:
            return True
    return False


@compiled
def hides_rod(x: float, y: float, depth: float, rods: Array, radii: Array) -> bool:
    """Whether a rod with axis ``rods`` [C, 2, 3] and round ends comes between the centre and ``depth`` on (x, y, 1).

    A rod is in front if the point of its axis that is nearest to the ray is.
    """
    norm = math.sqrt(x * x + y * y + 1.0)
    d0, d1, d2 = x / norm, y / norm, 1.0 / norm
    for k in range(len(rods)):
        a, b = rods[k, 0], rods[k, 1]
        u0, u1, u2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        uu = u0 * u0 + u1 * u1 + u2 * u2
        du = d0 * u0 + d1 * u1 + d2 * u2
        da = d0 * a[0] + d1 * a[1] + d2 * a[2]
        ua = u0 * a[0] + u1 * a[1] + u2 * a[2]
        across = uu - du * du
        s = (du * da - ua) / across if across > 1e-15 else 0.0
        s = min(max(s, 0.0), 1.0)
        p0, p1, p2 = a[0] + s * u0, a[1] + s * u1, a[2] + s * u2
        t = d0 * p0 + d1 * p1 + d2 * p2
        gap = (p0 - t * d0) ** 2 + (p1 - t * d1) ** 2 + (p2 - t * d2) ** 2
        if t > 0.0 and p2 < depth and gap < radii[k] ** 2:
            return True
    return False


@compiled
def hidden(points: Array, margin: float, triangles: Array, rods: Array, radii: Array) -> Mask:
    """Whether each of ``points`` [N, 3] lies behind a triangle (by more than ``margin``) or a rod."""
    found = np.zeros(len(points), np.bool_)
    for n in range(len(points)):
        z = points[n, 2]
        if z > 0.0:
            x, y = points[n, 0] / z, points[n, 1] / z
            found[n] = hides_triangle(x, y, z - margin, triangles) or hides_rod(x, y, z, rods, radii)
    return found


@compiled
def _ramp(x: float) -> float:
    return x * x if x > 0.0 else 0.0


@compiled
def _right(t: float, a: float, b: float) -> float:
    """Part of a sample that lies right of an edge which is ``t`` to its left.

    The sample is a square, whose sides change t by ``a`` and ``b``; all are lengths in the plane of the pattern.
    """
    wide, narrow = max(abs(a), abs(b)), min(abs(a), abs(b))
    narrow = max(narrow, 1e-4 * wide)
    out, flat = 0.5 * (wide + narrow), 0.5 * (wide - narrow)
    if t >= out:
        return 1.0
    if t <= -out:
        return 0.0
    return (_ramp(t + out) - _ramp(t + flat) - _ramp(t - flat)) / (2.0 * wide * narrow)


@compiled
def _white(kind: int, u: float, v: float, half: float, slope: Array) -> float:
    """Part of the sample at the point (u, v) of a marker's plane that reflects; ``slope`` [2, 2]: its sides there."""
    if kind == CHEQUER:
        a, b, c, d = slope[0, 0], slope[0, 1], slope[1, 0], slope[1, 1]
        left, right = _right(u + half, a, b), _right(u - half, a, b)
        if left == right:
            return 0.0
        below, above = _right(v + half, c, d), _right(v - half, c, d)
        u0, v0 = _right(u, a, b), _right(v, c, d)
        return (u0 - right) * (v0 - above) + (left - u0) * (below - v0)
    wide = math.sqrt(abs(slope[0, 0] * slope[1, 1] - slope[0, 1] * slope[1, 0]))
    return min(max((half - math.sqrt(u * u + v * v)) / wide + 0.5, 0.0), 1.0)


@compiled
def sample_marker(
    table: Array, left: float, top: float, over: int, kind: int, half: float, centres: Array, axes: Array,
    slopes: Array, light: Array, margin: float, triangles: Array, rods: Array, radii: Array, out: Array,
) -> None:  # fmt: skip
    """Sample a marker's brightness on a grid of ``over`` by ``over`` points in each pixel, at S instants.

    Args:
        table: of :func:`ray_table`.
        left: column of the table of the first pixel.
        top: row of the table of the first pixel.
        over: samples along a pixel's edge.
        kind: CHEQUER, DOT or BALL.
        half: half the marker's width, or its radius, m.
        centres: [S, 3] of the marker.
        axes: [S, 3, 3]; rows are two tangents and the normal.
        slopes: [S, 2, 2] change of both coordinates in the marker's plane from a sample to the next, along x and y, m.
        light: [S] brightness of a reflecting point.
        margin: distance behind a triangle from which a point is hidden, m.
        triangles: [S, M, 3, 3] that may hide the marker.
        rods: [S, C, 2, 3], ends of rods that may hide it.
        radii: [C] of the rods.
        out: [S, rows * over, columns * over]; the result.
    """
    for i in range(out.shape[1]):
        for j in range(out.shape[2]):
            x, y = _ray(table, left - 0.5 + (j + 0.5) / over, top - 0.5 + (i + 0.5) / over)
            for s in range(out.shape[0]):
                out[s, i, j] = 0.0
                c = centres[s]
                if math.isnan(x) or light[s] == 0.0:
                    continue
                if kind == BALL:
                    depth = (x * c[0] + y * c[1] + c[2]) / (x * x + y * y + 1.0)
                    u, v = math.sqrt((depth * x - c[0]) ** 2 + (depth * y - c[1]) ** 2 + (depth - c[2]) ** 2), 0.0
                else:
                    a = axes[s]
                    down = x * a[2, 0] + y * a[2, 1] + a[2, 2]
                    depth = (c[0] * a[2, 0] + c[1] * a[2, 1] + c[2] * a[2, 2]) / down
                    r0, r1, r2 = depth * x - c[0], depth * y - c[1], depth - c[2]
                    u, v = r0 * a[0, 0] + r1 * a[0, 1] + r2 * a[0, 2], r0 * a[1, 0] + r1 * a[1, 1] + r2 * a[1, 2]
                white = _white(kind, u, v, half, slopes[s])
                if white <= 0.0 or depth <= 0.0:
                    continue
                if hides_triangle(x, y, depth - margin, triangles[s]) or hides_rod(x, y, depth, rods[s], radii):
                    continue
                out[s, i, j] = light[s] * white


@compiled
def fill_triangles(image: Array, corners: Array, values: Array) -> None:
    """Write each triangle's value into the pixels of ``image`` [H, W] whose centre it covers.

    ``corners`` [M, 3, 2] in pixels; later triangles overwrite earlier ones.
    """
    height, width = image.shape
    for m in range(len(corners)):
        t = corners[m]
        low = max(0, math.ceil(min(t[0, 1], t[1, 1], t[2, 1])))
        high = min(height - 1, math.floor(max(t[0, 1], t[1, 1], t[2, 1])))
        for i in range(low, high + 1):
            first, last = np.inf, -np.inf
            for k in range(3):
                p, q = t[k], t[(k + 1) % 3]
                if p[1] == q[1] or (i - p[1]) * (i - q[1]) > 0.0:
                    continue
                x = p[0] + (i - p[1]) * (q[0] - p[0]) / (q[1] - p[1])
                first, last = min(first, x), max(last, x)
            for j in range(max(0, math.ceil(max(first, -1.0))), min(width - 1, math.floor(min(last, width))) + 1):
                image[i, j] = values[m]


@compiled
def fill_rods(image: Array, table: Array, pad: int, rods: Array, radii: Array, values: Array, box: Array) -> None:
    """Write each rod's value into the pixels of ``image`` whose centre it covers, within ``box``.

    ``box``: first and last row, first and last column of the search.
    """
    one = np.empty(1)
    for i in range(box[0], box[1] + 1):
        for j in range(box[2], box[3] + 1):
            x, y = table[i + pad, j + pad]
            for k in range(len(rods)):
                one[0] = radii[k]
                if hides_rod(x, y, np.inf, rods[k : k + 1], one):
                    image[i, j] = values[k]


@compiled
def sample_board(
    table: Array, left: int, top: int, over: int, centre: Array, axes: Array, slope: Array, squares: Array,
    side: float, border: float, shades: Array, out: Array,
) -> None:  # fmt: skip
    """Sample a chessboard on a grid of ``over`` by ``over`` points in each pixel, into ``out`` [rows, columns].

    ``squares``: numbers of squares along both axes; ``border``: width of the white margin, m; ``shades``: of black,
    white and the surroundings; the other arguments are those of :func:`sample_marker`.
    """
    wide, high = squares[0] * side / 2.0, squares[1] * side / 2.0
    a, b, c, d = slope[0, 0], slope[0, 1], slope[1, 0], slope[1, 1]
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            x, y = _ray(table, left - 0.5 + (j + 0.5) / over, top - 0.5 + (i + 0.5) / over)
            down = x * axes[2, 0] + y * axes[2, 1] + axes[2, 2]
            depth = (centre[0] * axes[2, 0] + centre[1] * axes[2, 1] + centre[2] * axes[2, 2]) / down
            r0, r1, r2 = depth * x - centre[0], depth * y - centre[1], depth - centre[2]
            u = r0 * axes[0, 0] + r1 * axes[0, 1] + r2 * axes[0, 2]
            v = r0 * axes[1, 0] + r1 * axes[1, 1] + r2 * axes[1, 2]
            if not (depth > 0.0 and abs(u) < wide + 2 * border and abs(v) < high + 2 * border):
                out[i, j] = shades[2]
                continue
            p, q = round((u + wide) / side), round((v + high) / side)  # the nearest lines between squares
            signed = (2.0 * _right(u + wide - p * side, a, b) - 1.0) * (2.0 * _right(v + high - q * side, c, d) - 1.0)
            if (p + q) % 2 == 1:
                signed = -signed
            pattern = 0.5 * (shades[0] + shades[1]) + 0.5 * (shades[0] - shades[1]) * signed
            inner = _right(wide - abs(u), a, b) * _right(high - abs(v), c, d)
            whole = _right(wide + border - abs(u), a, b) * _right(high + border - abs(v), c, d)
            sheet = inner * pattern + (1.0 - inner) * shades[1]
            out[i, j] = whole * sheet + (1.0 - whole) * shades[2]
