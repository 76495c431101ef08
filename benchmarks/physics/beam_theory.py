"""Reference solutions of cantilevered beams: frequencies by Ritz's method, and the elastica.

Ritz's method with polynomials that satisfy the clamped end converges exponentially for sections that vary smoothly; on
uniform beams it gives the closed forms to ten digits (tests/sim/wing/test_beams.py). Rectangular sections, chord and
thickness linear along the span.
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
_TERMS, _POINTS = 20, 64


def torsion_constant(width: Array | float, thickness: Array | float) -> Array:
    """Saint-Venant's torsion constant of a rectangle, m^4, by its series (Timoshenko and Goodier, section 109)."""
    n = np.arange(1, 200, 2)
    long, short = np.maximum(width, thickness), np.minimum(width, thickness)
    ratio = np.asarray(long / short)
    series = (np.tanh(0.5 * np.pi * ratio[..., None] * n) / n**5).sum(axis=-1)
    return np.asarray(long * short**3 / 3 * (1 - 192 / np.pi**5 / ratio * series))


@dataclass(frozen=True)
class Beam:
    """Rectangular beam of foam, clamped at the root; chord and thickness (m) at root and tip, linear between.

    ``young``, ``shear`` in Pa, ``density`` in kg/m^3. The whole area carries shear (coefficient 1), as in the thesis's
    K_t (Eq. 16).
    """

    length: float
    chord: tuple[float, float]
    thickness: tuple[float, float]
    density: float = 40.0
    young: float = 7e6
    shear: float = 2.6e6

    def at(self, y: Array) -> tuple[Array, Array]:
        """Chord and thickness (m) at span positions ``y`` (m)."""
        t = y / self.length
        return (
            self.chord[0] + t * (self.chord[1] - self.chord[0]),
            self.thickness[0] + t * (self.thickness[1] - self.thickness[0]),
        )

    def second_moment(self, family: Family, y: Array) -> Array:
        """Second moment of area (m^4) for bending out of or in the plane of the chord."""
        c, h = self.at(y)
        return c * h**3 / 12 if family == "flapwise" else h * c**3 / 12


def _basis(s: Array, power: int) -> tuple[Array, Array, Array]:
    """Ritz basis on [0, 1]: Legendre polynomials times s^power; values and two derivatives, [terms, points] each."""
    rows: tuple[list[Array], list[Array], list[Array]] = ([], [], [])
    f, df, ddf = s**power, power * s ** (power - 1), power * (power - 1) * s ** max(power - 2, 0)
    for k in range(_TERMS):
        series = np.polynomial.Legendre.basis(k, domain=[0, 1])
        p, dp, ddp = series(s), series.deriv()(s), series.deriv(2)(s)
        for row, q in zip(rows, (f * p, df * p + f * dp, ddf * p + 2 * df * dp + f * ddp), strict=True):
            row.append(q)
    return np.array(rows[0]), np.array(rows[1]), np.array(rows[2])


def _grid(beam: Beam, root: float) -> tuple[Array, Array, Array, float]:
    """Gauss points as fractions of the free length and as y (m), their weights (m), and the free length (m).

    ``root``: y of the clamped end, m.
    """
    x, w = np.polynomial.legendre.leggauss(_POINTS)
    free = beam.length - root
    s = 0.5 * (x + 1)
    return s, root + free * s, 0.5 * free * w, free


def _lowest(K: Array, M: Array, count: int) -> Array:
    """Lowest ``count`` frequencies (Hz) of stiffness ``K`` and mass ``M`` [terms, terms].

    They are computed as the largest eigenvalues of (M, K), because small eigenvalues of (K, M) lose digits.
    """
    mu = eigh(M, K, eigvals_only=True)[::-1][:count]
    return np.asarray(1 / (2 * math.pi * np.sqrt(mu)))


def euler_bernoulli(beam: Beam, family: Family, root: float = 0.0, count: int = 3) -> Array:
    """First ``count`` frequencies (Hz) of (EI w'')'' = rho A omega^2 w, clamped at = ``root`` (m), free at the tip."""
    s, y, weight, free = _grid(beam, root)
    c, h = beam.at(y)
    value, _, second = _basis(s, 2)
    K = (second * (weight * beam.young * beam.second_moment(family, y))) @ second.T / free**4
    M = (value * (weight * beam.density * c * h)) @ value.T
    return _lowest(K, M, count)


def timoshenko(beam: Beam, family: Family, root: float = 0.0, count: int = 3) -> Array:
    """Frequencies as :func:`euler_bernoulli`, but with shear and rotary inertia (Timoshenko 1921)."""
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
    """First torsional frequencies (Hz) of (G J theta')' = -rho I_p omega^2 theta (Saint-Venant).

    With ``warping`` the clamped end also stays flat, as that of a plate: the term (E Gamma theta'')'' is added, where
    Gamma is ``warping`` times the c^3 h^3 / 144 of a thin strip of chord c and thickness h (Reissner and Stein, NACA TN
    2369, 1951).
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
    """First three frequencies (Hz) of a family of modes, clamped at y = ``root``.

    ``slender`` omits shear and rotary inertia. ``chordwise``: number of bodies that divide the chord in the model to be
    compared. They have 1 - 1 / chordwise^2 of the plate's resistance to warping: with width w and position x of a body
    on the chord c, the sum of w x^2 over the bodies instead of c^3 / 12.
    """
    if family == "torsion":
        return torsional(beam, root, warping=1 - 1 / chordwise**2)
    theory: Callable[[Beam, Family, float], Array] = euler_bernoulli if slender else timoshenko
    return theory(beam, family, root)


def elastica(load: float) -> tuple[float, float, float]:
    """Large deflection of a cantilever under a constant tip load across its rest axis.

    Returns deflection / L, shortening / L and tip rotation (rad), L the length.

    ``load`` is P L^2 / E I. Solves theta'' = -load cos theta, theta(0) = 0, theta'(1) = 0 by shooting (Bisshopp and
    Drucker, Q. Appl. Math. 3, 1945, solve it by elliptic integrals).
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
