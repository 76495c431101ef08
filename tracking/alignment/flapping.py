"""Period of the flapping in the recorded frames, and the mean of the drive's flap angle: the zero of the angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from wingfit.records.array_types import Array
from wingfit.records.drive import Drive, FourBarDrive, FourierSeries
from wingfit.tracking.noise import products

_HARMONICS = 4
_LEAST_EXPLAINED = 0.8
_TURN = 720


@dataclass(frozen=True, eq=False)
class Flapping:
    """The flapping as it appears in the frames.

    Attributes:
        frequency: apparent, Hz: with a strobe it is not the flap frequency.
        explained: part of the variance of the flap angle that this period explains.
        mean: [T] weights whose sum with the samples is their mean over the beat.
        harmonics: complex amplitudes [5] of the flap angle (rad); the first is the mean.
    """

    frequency: float
    explained: float
    mean: Array
    harmonics: Array


def flapping_of(times: Array, angle: Array) -> Flapping:
    """Return the flapping of the flap ``angle`` [T] (rad; NaN where unknown) at ``times`` [T], s."""
    seen = np.isfinite(angle)
    t, y = times[seen] - times[0], angle[seen]
    span = float(t[-1])
    step = float(np.median(np.diff(t)))
    highest = min(0.25 / step, len(t) / 6 / span)
    grid = np.arange(0.8 / span, max(highest, 1.0 / span), 0.1 / span)
    first = float(grid[int(np.argmin([_left(t, y, f) for f in grid]))])
    # Of a period and its multiples, which explain as much, the shortest is right.
    for parts in (4, 3, 2):
        if parts * first <= highest and _left(t, y, parts * first) < 1.3 * _left(t, y, first) + 1e-3 * float(y.var()):
            first *= parts
            break
    width = 0.1 / span
    best = minimize_scalar(lambda f: _left(t, y, f), bounds=(first - width, first + width), method="bounded")
    X = basis(t, float(best.x))
    inverse = np.linalg.inv(products(X, X))
    weights = np.zeros(len(times))
    weights[seen] = X @ inverse[0]
    c = inverse @ (X.T @ y)
    harmonics = np.array([c[0], *(c[1 + 2 * k] - 1j * c[2 + 2 * k] for k in range(_HARMONICS))])
    return Flapping(float(best.x), 1 - _left(t, y, float(best.x)) / max(float(y.var()), 1e-300), weights, harmonics)


def basis(t: Array, frequency: float) -> Array:
    """Return the columns 1, cos, sin, cos 2, sin 2, ... [N, 9] of ``frequency`` (Hz) at times ``t`` [N], s."""
    turn = 2 * np.pi * frequency * t
    return np.column_stack([np.ones_like(t), *(f(k * turn) for k in range(1, _HARMONICS + 1) for f in (np.cos, np.sin))])


def _left(t: Array, y: Array, frequency: float) -> float:
    """Variance that a Fourier series of ``frequency`` leaves, rad^2."""
    X = basis(t, frequency)
    normal = products(X, X) + 1e-9 * len(t) * np.eye(X.shape[1])
    return float(np.mean((y - X @ np.linalg.solve(normal, X.T @ y)) ** 2))


def drive_series(drive: Drive) -> Array:
    """Complex amplitudes [5] of the driving rod's angle (rad) over the drive phase; the first is the mean.

    A four-bar linkage closes as Freudenstein's equation says (1955); its rocker lies clockwise of the line from its
    pivot to the crank pin.
    """
    if isinstance(drive, FourierSeries):
        found = np.zeros(_HARMONICS + 1, complex)
        found[: len(drive.series)] = drive.series[: _HARMONICS + 1]
        return found
    found = 2 * np.fft.rfft(_rocker(drive))[: _HARMONICS + 1] / _TURN
    found[0] /= 2
    return np.asarray(found)


def _rocker(link: FourBarDrive) -> Array:
    psi = 2 * np.pi * np.arange(_TURN) / _TURN
    x, y = link.crank * np.cos(psi) - link.ground, link.crank * np.sin(psi)
    k = (link.rocker**2 - link.coupler**2 + x**2 + y**2) / (2 * link.rocker)
    angle = np.unwrap(2 * np.arctan2(y - np.sqrt(x**2 + y**2 - k**2), x + k)) + link.offset
    return np.asarray(angle - 2 * np.pi * np.round(angle.mean() / (2 * np.pi)))


def half_range(harmonics: Array) -> float:
    """Return half the range of the angle with the complex amplitudes ``harmonics`` [5], rad."""
    turn = np.exp(2j * np.pi * np.outer(np.arange(_TURN) / _TURN, np.arange(len(harmonics))))
    return float(np.ptp((turn @ harmonics).real) / 2)
