"""Reference solutions of cantilevered beams: natural frequencies by Ritz's method, and large static deflection.

Ritz's method with polynomials that satisfy the clamped end converges exponentially for sections that vary smoothly; on
uniform beams it gives the closed forms to ten digits (tests/sim/wing/test_beams.py). Sections are rectangular, with
chord and thickness linear along the span. E is Young's modulus, G the shear modulus, I the second moment of area, A the
area, rho the density, J the torsion constant, I_p the polar second moment of area, omega the angular frequency.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp
from scipy.linalg import eigh
from scipy.optimize import brentq

Array = npt.NDArray[np.float64]
Family = Literal["flapwise", "in-plane", "torsion"]

# Dimensionless frequencies of the uniform clamped-free beam: roots of cos x cosh x = -1 (Blevins 1979, table 8-1).
CANTILEVER_ROOTS = (1.8751040687119611, 4.6940911329741746, 7.8547574382376126)
_TERMS, _POINTS = 20, 64  # number of basis functions, and of points of integration


def torsion_constant(width: Array | float, thickness: Array | float) -> Array:
    """Return Saint-Venant's torsion constant (m^4) of rectangles ``width`` by ``thickness`` (m), by its series.

    Timoshenko and Goodier, Theory of Elasticity, section 109.
    """
    n = np.arange(1, 200, 2)
    long, short = np.maximum(width, thickness), np.minimum(width, thickness)
    ratio = np.asarray(long / short)
    series = (np.tanh(0.5 * np.pi * ratio[..., None] * n) / n**5).sum(axis=-1)
    return np.asarray(long * short**3 / 3 * (1 - 192 / np.pi**5 / ratio * series))


@dataclass(frozen=True)
class Beam:
    """Rectangular beam of foam, clamped at the root, with a ``length`` in m.

    ``chord`` and ``thickness`` (m): at root and tip, linear between; ``young``, ``shear``: moduli, Pa; ``density``:
    kg/m^3. The whole area carries shear (shear coefficient 1), as in K_t of van der Grinten's thesis (Eq. 16).
    """

    length: float
    chord: tuple[float, float]
    thickness: tuple[float, float]
    density: float = 40.0
    young: float = 7e6
    shear: float = 2.6e6

    def at(self, y: Array) -> tuple[Array, Array]:
        """Return chord and thickness (m) at the distances ``y`` (m) from the root."""
        t = y / self.length
        return (
            self.chord[0] + t * (self.chord[1] - self.chord[0]),
            self.thickness[0] + t * (self.thickness[1] - self.thickness[0]),
        )

    def second_moment(self, family: Family, y: Array) -> Array:
        """Return the second moments of area (m^4) at the distances ``y`` (m) from the root.

        ``family``: "flapwise" for bending across the chord's plane, otherwise for bending within it.
        """
        c, h = self.at(y)
        return c * h**3 / 12 if family == "flapwise" else h * c**3 / 12


def _basis(s: Array, power: int) -> tuple[Array, Array, Array]:
    """Return the Ritz basis at ``s`` [points] in [0, 1]: s^power times Legendre polynomials.

    The result is the values, first and second derivatives, [terms, points] each. With ``power`` 1 the values vanish at
    s = 0, with 2 also the first derivatives.
    """
    rows: tuple[list[Array], list[Array], list[Array]] = ([], [], [])
    f, df, ddf = s**power, power * s ** (power - 1), power * (power - 1) * s ** max(power - 2, 0)
    for k in range(_TERMS):
        series = np.polynomial.Legendre.basis(k, domain=[0, 1])
        p, dp, ddp = series(s), series.deriv()(s), series.deriv(2)(s)
        for row, q in zip(rows, (f * p, df * p + f * dp, ddf * p + 2 * df * dp + f * ddp), strict=True):
            row.append(q)
    return np.array(rows[0]), np.array(rows[1]), np.array(rows[2])


def _grid(beam: Beam, root: float) -> tuple[Array, Array, Array, float]:
    """Return the Gauss points of integration over the free part of ``beam``, which begins at y = ``root`` (m).

    They are given as fractions of the free length and as y (m), with their weights (m); last comes the free length (m).
    """
    x, w = np.polynomial.legendre.leggauss(_POINTS)
    free = beam.length - root
    s = 0.5 * (x + 1)
    return s, root + free * s, 0.5 * free * w, free


def _lowest(K: Array, M: Array, count: int) -> Array:
    """Return the lowest ``count`` natural frequencies (Hz) of stiffness ``K`` and mass ``M`` [terms, terms].

    They are computed as the largest eigenvalues of (M, K), because small eigenvalues of (K, M) lose digits.
    """
    mu = eigh(M, K, eigvals_only=True)[::-1][:count]
    return np.asarray(1 / (2 * math.pi * np.sqrt(mu)))


def euler_bernoulli(beam: Beam, family: Family, root: float = 0.0, count: int = 3) -> Array:
    """Return the first ``count`` natural frequencies (Hz) of bending, (EI w'')'' = rho A omega^2 w.

    ``family``: direction of bending, as in Beam.second_moment. The beam is clamped at y = ``root`` (m) and free at the
    tip; w is its deflection.
    """
    s, y, weight, free = _grid(beam, root)
    c, h = beam.at(y)
    value, _, second = _basis(s, 2)
    K = (second * (weight * beam.young * beam.second_moment(family, y))) @ second.T / free**4
    M = (value * (weight * beam.density * c * h)) @ value.T
    return _lowest(K, M, count)


def timoshenko(beam: Beam, family: Family, root: float = 0.0, count: int = 3) -> Array:
    """Return frequencies as :func:`euler_bernoulli`, but with shear and rotary inertia (Timoshenko 1921)."""
    s, y, weight, free = _grid(beam, root)
    c, h = beam.at(y)
    value, slope, _ = _basis(s, 1)
    slope = slope / free
    inertia = beam.second_moment(family, y)
    zero = np.zeros_like(value)
    strain, bend = np.concatenate([slope, -value]), np.concatenate([zero, slope])
    K = (strain * (weight * beam.shear * c * h)) @ strain.T + (bend * (weight * beam.young * inertia)) @ bend.T
    move, turn = np.concatenate([value, zero]), np.concatenate([zero, value])
    M = (move * (weight * beam.density * c * h)) @ move.T + (turn * (weight * beam.density * inertia)) @ turn.T
    return _lowest(K, M, count)


def torsional(beam: Beam, root: float = 0.0, count: int = 3, *, warping: float = 0.0) -> Array:
    """Return the first ``count`` torsional frequencies (Hz) of (G J theta')' = -rho I_p omega^2 theta (Saint-Venant).

    theta is the twist; the beam is clamped at y = ``root`` (m). With ``warping`` the clamped end also stays flat, as
    that of a plate: the term (E Gamma theta'')'' is subtracted on the left, where Gamma is ``warping`` times the c^3
    h^3 / 144 of a thin strip of chord c and thickness h (Reissner and Stein, NACA TN 2369, 1951).
    """
    s, y, weight, free = _grid(beam, root)
    c, h = beam.at(y)
    value, slope, second = _basis(s, 2 if warping else 1)
    slope, second = slope / free, second / free**2
    polar = c * h * (c**2 + h**2) / 12
    K = (slope * (weight * beam.shear * torsion_constant(c, h))) @ slope.T
    K = K + (second * (weight * warping * beam.young * c**3 * h**3 / 144)) @ second.T
    M = (value * (weight * beam.density * polar)) @ value.T
    return _lowest(K, M, count)


def reference(beam: Beam, family: Family, root: float = 0.0, *, slender: bool = True, chordwise: int = 1) -> Array:
    """Return the first three frequencies (Hz) of a family of modes of ``beam``, clamped at y = ``root`` (m).

    ``slender``: whether to omit shear and rotary inertia; ``chordwise``: number of bodies that divide the chord in the
    model to be compared. Such bodies have 1 - 1 / chordwise^2 of a plate's resistance to warping: with width w and
    position x of a body on the chord c, the sum of w x^2 over the bodies instead of c^3 / 12.
    """
    if family == "torsion":
        return torsional(beam, root, warping=1 - 1 / chordwise**2)
    theory: Callable[[Beam, Family, float], Array] = euler_bernoulli if slender else timoshenko
    return theory(beam, family, root)


def elastica(load: float) -> tuple[float, float, float]:
    """Compute the large deflection of a cantilever (an elastica) under a constant tip load across its rest axis.

    ``load`` is P L^2 / (E I), with force P and length L. Returns deflection / L, shortening / L (along the rest axis)
    and tip rotation (rad). With the slope theta, solves theta'' = -load cos theta, theta(0) = 0, theta'(1) = 0 by
    shooting (Bisshopp and Drucker, Q. Appl. Math. 3, 1945, solve it by elliptic integrals).
    """

    def shoot(curvature: float) -> Array:
        def rate(_: float, u: Array) -> list[float]:
            theta = float(u[0])
            return [float(u[1]), -load * math.cos(theta), math.sin(theta), math.cos(theta)]

        found = solve_ivp(rate, (0.0, 1.0), [0.0, curvature, 0.0, 0.0], rtol=1e-11, atol=1e-13)
        return np.asarray(found.y[:, -1])

    root = brentq(lambda k: float(shoot(k)[1]), 0.0, load, xtol=1e-13)
    theta, _, sag, reach = shoot(root)
    return float(sag), float(1 - reach), float(theta)
