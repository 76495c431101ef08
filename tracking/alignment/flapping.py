"""Period of the flapping in the recorded frames, and the mean of the drive's flap angle: the zero of the angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from wingfit.records.array_types import Array
from wingfit.records.drive import Drive, FourBarDrive, FourierSeries
from wingfit.tracking.noise import products

MOST_FRAMES = 300  # of which every period is tried
_HARMONICS = 4
_LEAST_EXPLAINED = 0.8
_LEAST_BEATS = 0.9  # in the recording
_STEP = 0.04  # of the frequencies that are tried, periods per recording
_REFINED = 6
_AS_GOOD = 2.0  # ratio of the variances that two periods leave
_TURN = 720
_MOST_REFINED = 1500  # frames from which the frequency is refined
_NEAR_SET = 0.02  # of the frequency that the user set: how far the true one may be from it


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


def flapping_of(times: Array, angle: Array, trend: int = 0, known: float | None = None) -> Flapping:
    """Return the flapping of the flap ``angle`` [T] (rad; NaN where unknown) at ``times`` [T], s.

    ``trend``: order of a polynomial over time that is not part of the flapping, nor of the result. ``known``:
    frequency (Hz) near which the right one is; by default all are tried.
    """
    seen = np.isfinite(angle)
    t, y = times[seen] - times[0], angle[seen]
    powers = np.polynomial.legendre.legvander(2 * t / t[-1] - 1, trend)[:, 1:]
    span = float(t[-1])
    step = float(np.median(np.diff(t)))
    highest = min(0.25 / step, len(t) / 6 / span)
    if known:
        best = _near(t, y, powers, known)
    else:
        grid = np.arange(_LEAST_BEATS / span, max(highest, 1.2 / span), _STEP / span)
        left = np.array([_left(t, y, powers, f) for f in grid])
        ends = [_near(t, y, powers, float(grid[k])) for k in np.argsort(left)[:_REFINED]]
        best = min(ends, key=lambda f: _left(t, y, powers, f))
    # Of a period and its parts, which explain as much, the shortest is right.
    for parts in () if known else (4, 3, 2):
        if parts * best > highest:
            continue
        shorter = _near(t, y, powers, parts * best)
        if _left(t, y, powers, shorter) < _AS_GOOD * _left(t, y, powers, best) + 1e-4 * float(y.var()):
            best = shorter
            break
    X = np.column_stack([basis(t, best), powers])
    inverse = np.linalg.inv(products(X, X))
    weights = np.zeros(len(times))
    weights[seen] = X @ inverse[0]
    c = inverse @ (X.T @ y)
    harmonics = np.array([c[0], *(c[1 + 2 * k] - 1j * c[2 + 2 * k] for k in range(_HARMONICS))])
    return Flapping(best, 1 - _left(t, y, powers, best) / max(float(y.var()), 1e-300), weights, harmonics)


def refined(times: Array, positions: Array, frequency: float) -> float:
    """Return the ``frequency`` (Hz) again, from all markers: that whose Fourier series leave least of their motion.

    ``positions`` [T, N, 3] (m; NaN: not seen) at ``times`` [T], s. The flap angle of a frame has an error that all
    frames of a pose share with the rest positions; the markers themselves repeat to the noise of the cameras.
    """
    some = np.unique(np.linspace(0, len(times) - 1, _MOST_REFINED).astype(int)) if len(times) > _MOST_REFINED else ...
    t, places = times[some] - times[0], positions[some]
    seen = np.isfinite(places[..., 0])
    parts = [
        (t[mask], places[mask, n] - places[mask, n].mean(axis=0))
        for n, mask in enumerate(seen.T)
        if mask.sum() > 2 * (1 + 2 * _HARMONICS)
    ]
    if not parts:
        return frequency

    def left(tried: float) -> float:
        total = 0.0
        for at, own in parts:
            columns, _ = np.linalg.qr(basis(at, tried))
            total += float(np.sum((own - columns @ (columns.T @ own)) ** 2))
        return total

    width = 0.06 / float(t[-1])
    ends = (frequency - width, frequency + width)
    return float(minimize_scalar(left, bounds=ends, method="bounded", options={"xatol": 1e-6 * width}).x)


def true_frequency(apparent: float, step: float, set_hz: float) -> float | None:
    """Return the flap frequency (Hz) near ``set_hz`` that appears as ``apparent`` (Hz) in frames a ``step`` (s) apart.

    None if none is near: the frames would show another motion, or two frequencies are equally near.
    """
    rate = 1 / step
    beats = np.round(set_hz / rate) + np.arange(-1, 2)
    tried = np.sort(np.unique(np.abs(np.concatenate([beats * rate + apparent, beats * rate - apparent]))))
    best, *others = sorted(tried.tolist(), key=lambda one: abs(one - set_hz))
    apart = abs(best - set_hz)
    if apart > _NEAR_SET * set_hz or any(abs(one - set_hz) < 2 * apart for one in others):
        return None
    return float(best)


def strongest(times: Array, angle: Array) -> float:
    """Return the apparent frequency (Hz) of the flap ``angle`` [T] (rad; NaN where unknown) at ``times`` [T], s.

    For recordings that are too long to try every period: the largest line of the spectrum, refined.
    """
    seen = np.isfinite(angle)
    t, y = times[seen] - times[seen][0], angle[seen]
    even = np.linspace(0.0, float(t[-1]), len(t))
    spectrum = np.abs(np.fft.rfft(np.interp(even, t, y - np.polyval(np.polyfit(t, y, 2), t))))
    line = (1 + int(np.argmax(spectrum[1:]))) / float(t[-1])
    powers = np.polynomial.legendre.legvander(2 * t / t[-1] - 1, 2)[:, 1:]
    grid = line + np.arange(-1.0, 1.0, 0.1) / float(t[-1])
    grid = grid[grid * t[-1] > _LEAST_BEATS]
    best = min(grid.tolist(), key=lambda f: _left(t, y, powers, f), default=_LEAST_BEATS / float(t[-1]))
    return _near(t, y, powers, best)


def _near(t: Array, y: Array, powers: Array, frequency: float) -> float:
    width = 0.06 / float(t[-1])
    ends = (frequency - width, frequency + width)
    found = minimize_scalar(
        lambda f: _left(t, y, powers, f), bounds=ends, method="bounded", options={"xatol": 1e-5 * width}
    )
    return float(found.x)


def basis(t: Array, frequency: float) -> Array:
    """Return the columns 1, cos, sin, cos 2, sin 2, ... [N, 9] of ``frequency`` (Hz) at times ``t`` [N], s."""
    turn = 2 * np.pi * frequency * t
    return np.column_stack(
        [np.ones_like(t), *(f(k * turn) for k in range(1, _HARMONICS + 1) for f in (np.cos, np.sin))]
    )


def _left(t: Array, y: Array, powers: Array, frequency: float) -> float:
    """Variance that a Fourier series of ``frequency`` and the columns ``powers`` leave, rad^2."""
    X = np.column_stack([basis(t, frequency), powers])
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
