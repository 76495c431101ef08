"""The noise of the tracks, from the recordings alone: scatter of each marker about its own mean beat."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq
from scipy.signal import lfilter

from wingfit.records import Recording
from wingfit.records.blas_threads import one_blas_thread

Array = npt.NDArray[np.float64]

HARMONICS = 8  # of the mean beat
LONGEST_MEMORY = 0.97


@one_blas_thread
def noise_distance(recordings: tuple[Recording, ...]) -> float | None:
    """Mean distance (m) that tracking noise alone leaves; None when no recording has frames enough.

    The mean beat of a channel is a Fourier series fitted to its frames, which lie over several beats. Noise that is
    correlated from frame to frame looks like a slow wave, and the fit swallows more of it than of white noise; the
    scatter is corrected for that with the correlation of the residuals. Errors that repeat with the beat are not noise
    in this sense.
    """
    total, count = 0.0, 0
    for recording in recordings:
        basis = _basis(2 * np.pi * recording.condition.flap_frequency * recording.times)
        tracks = [t for t in np.moveaxis(recording.positions, 1, 0) if _seen(t).sum() >= 2 * basis.shape[1]]
        if not tracks:
            continue
        residuals = [_residual(basis, track) for track in tracks]
        memory = _memory(basis, residuals)
        for track, residual in zip(tracks, residuals, strict=True):
            seen = _seen(track)
            left = 1.0 - _swallowed(basis[seen], np.flatnonzero(seen), memory)
            total += float(np.linalg.norm(residual[seen], axis=1).sum() / np.sqrt(left))
            count += int(seen.sum())
    return total / count if count else None


def _basis(psi: Array) -> Array:
    k = np.arange(1, HARMONICS + 1)
    return np.hstack([np.ones((len(psi), 1)), np.cos(psi[:, None] * k), np.sin(psi[:, None] * k)])


def _seen(track: Array) -> npt.NDArray[np.bool_]:
    return np.asarray(np.isfinite(track).all(axis=1))


def _residual(basis: Array, track: Array) -> Array:
    """Track minus its mean beat, [T, 3], NaN where not seen."""
    seen, out = _seen(track), np.full_like(track, np.nan)
    out[seen] = track[seen] - basis[seen] @ np.linalg.lstsq(basis[seen], track[seen], rcond=None)[0]
    return out


def _memory(basis: Array, residuals: list[Array]) -> float:
    """Correlation of successive frames, taking the noise as first-order autoregressive.

    The fit removes slow waves, so residuals are less alike than the noise; the memory is that whose residuals, after
    the same fit, would be as alike as these, pooled over all markers and axes.
    """
    products = [np.concatenate([(x[k:] * x[: len(x) - k]).ravel() for x in residuals]) for k in (0, 1)]
    own, next_ = (float(p[np.isfinite(p)].mean()) if np.isfinite(p).any() else 0.0 for p in products)
    if own <= 0:
        return 0.0
    q, _ = np.linalg.qr(basis)

    def excess(memory: float) -> float:
        kept, alike = _after_fit(q, memory)
        return alike / kept - next_ / own

    if excess(0.0) > 0:
        return 0.0
    return LONGEST_MEMORY if excess(LONGEST_MEMORY) < 0 else float(brentq(excess, 0.0, LONGEST_MEMORY, xtol=1e-3))


def _after_fit(q: Array, memory: float) -> tuple[float, float]:
    """Mean variance, and mean product of neighbours, of unit noise of that memory after a fit of ``q`` [T, P]."""
    covered = _covariance_times(q, memory)
    inner = q.T @ covered
    kept = 1.0 - np.trace(inner) / len(q)
    alike = memory - (q[:-1] * covered[1:] + covered[:-1] * q[1:] - (q[:-1] @ inner) * q[1:]).sum() / (len(q) - 1)
    return float(kept), float(alike)


def _swallowed(basis: Array, frames: npt.NDArray[np.int64], memory: float) -> float:
    """Fraction of the variance of first-order autoregressive noise that a fit of ``basis`` at ``frames`` removes."""
    q, _ = np.linalg.qr(basis)
    whole = np.zeros((int(frames[-1]) + 1, q.shape[1]))
    whole[frames] = q
    return float((whole * _covariance_times(whole, memory)).sum() / len(frames))


def _covariance_times(q: Array, memory: float) -> Array:
    """The matrix memory^|t - s| times ``q`` [T, P], by a filter forwards and one backwards."""
    forward = lfilter([1.0], [1.0, -memory], q, axis=0)
    backward = lfilter([1.0], [1.0, -memory], q[::-1], axis=0)[::-1]
    return np.asarray(forward + backward - q)
