"""The noise of the tracks, from the recordings alone: scatter of each marker about its own mean beat."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from records import Recording

Array = npt.NDArray[np.float64]

HARMONICS = 8  # of the mean beat


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
    lagged = [np.nanmean(np.concatenate([(x[k:] * x[: len(x) - k]).ravel() for x in residuals])) for k in (0, 1)]
    observed = lagged[1] / lagged[0]
    apart = np.abs(np.subtract.outer(np.arange(len(basis)), np.arange(len(basis))))
    q, _ = np.linalg.qr(basis)
    keep = np.eye(len(basis)) - q @ q.T

    def excess(memory: float) -> float:
        left = keep @ memory**apart @ keep
        return float(np.diag(left, 1).mean() / np.diag(left).mean() - observed)

    if excess(0.0) > 0:
        return 0.0
    return 0.97 if excess(0.97) < 0 else float(brentq(excess, 0.0, 0.97, xtol=1e-3))


def _swallowed(basis: Array, frames: npt.NDArray[np.int64], memory: float) -> float:
    """Fraction of the variance of first-order autoregressive noise that a fit of ``basis`` removes."""
    q, _ = np.linalg.qr(basis)
    covariance = memory ** np.abs(frames[:, None] - frames[None, :])
    return float(np.einsum("tk,ts,sk->", q, covariance, q) / len(frames))
