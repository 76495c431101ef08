"""A recording as the Fourier coefficients of its beat, and their noise, known from the scatter between beats.

A model's motion is periodic, so all that it predicts of a recording lies in the harmonics of the beat; all that lies
between the harmonics is noise (or a fault that is not periodic). Each channel is reduced to its mean, the harmonics up
to H, and three slow trends in which drifts and wrong rates show: of the mean, and of the first harmonic in phase and in
quadrature. The noise at a harmonic is read off the spectrum between the harmonics, whatever its colour.

Frames under a strobe follow each other in the order of the *apparent* beat, and noise is correlated in that order; the
spectrum is taken over apparent phase. A camera that is much faster than the wing is the case without aliasing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import elliprg

from wingfit.inference.noise.mean_beat import fourier_basis, scatter_about
from wingfit.inference.noise.spectrum import density_at_harmonics, lag1_autocorrelation
from wingfit.records import Recording
from wingfit.records.array_types import Array, Bool, Float, Index, Int, Mask
from wingfit.records.blas_threads import one_blas_thread

HARMONICS = 8  # of tracks: a wing of membrane and foam follows no faster
HARMONICS_OF_FORCES = 10
PASSED = 1.6  # cut-off frequencies of a low-pass above which nothing remains of a force
TRENDS = 3
SPARE = 1.5  # samples per coefficient, at least; a channel with fewer is not used
INFLATED = 5.0  # largest ratio of a coefficient's variance to that if it were fitted alone: more means long gaps


@dataclass(frozen=True)
class HarmonicFit:
    """The linear map from samples [T, C] of a recording to coefficients [C, P], and the noise of these.

    Attributes:
        order: [P] harmonic of each coefficient.
        trend: [P], True for slow trends.
        weight: [P] mean square over the samples of a coefficient of one.
        inverse: [C, P, T], least squares over the valid samples; zero where a sample is not valid.
        used: [C], False for a channel with too few samples.
        variance: [C, P] of the coefficients' noise.
        noise: [C] standard deviation of a sample's noise.
        lag1: correlation of the noise of successive samples, median of the channels.
        between_beats: whether the noise was estimated from the scatter between beats; else from what no harmonic
            explains.
        coefficients: [C, P] of the recording itself.
    """

    order: Int[Index, " P"]
    trend: Bool[Mask, " P"]
    weight: Float[Array, " P"]
    inverse: Float[Array, "C P T"]
    used: Bool[Mask, " C"]
    variance: Float[Array, "C P"]
    noise: Float[Array, " C"]
    lag1: float
    between_beats: bool
    coefficients: Float[Array, "C P"]

    def of(self, residuals: Float[Array, "*B T C"]) -> Float[Array, "*B C P"]:
        """Harmonic coefficients [..., C, P] of ``residuals`` [..., T, C] (NaN: not recorded), zero if not used."""
        filled = np.where(np.isfinite(residuals), residuals, 0.0)
        channels = np.moveaxis(filled, -1, 0).reshape(len(self.inverse), -1, filled.shape[-2])
        found = np.einsum("cbt,cpt->bcp", channels, self.inverse, optimize=True)
        return np.asarray(found.reshape(*residuals.shape[:-2], *self.variance.shape))


def harmonic_fit(recording: Recording, compared: Mask | None = None) -> HarmonicFit:
    """Reduce ``recording`` to the harmonic coefficients of its beat and their noise.

    ``compared`` [T, C] selects samples (None: all that were recorded). ValueError if no channel has enough samples, if
    no channel moves, or if all samples have the same phase.
    """
    scatter = _Scatter.of(recording, compared)
    inner, valid = scatter.inner, scatter.valid
    inverse = np.einsum("cpq,tq->cpt", inner, scatter.basis) * valid.T[:, None]
    density, scale = scatter.density
    return HarmonicFit(
        scatter.order,
        scatter.trend,
        np.mean(scatter.basis**2, axis=0),
        inverse,
        np.asarray(valid.any(axis=0)),
        np.einsum("cpp->cp", inner) * scale[:, None] * density[scatter.order],
        np.sqrt(scatter.variance),
        lag1_autocorrelation(scatter.values, valid),
        scatter.beats >= 2,
        np.einsum("cpt,tc->cp", inverse, np.where(valid, recording.values, 0.0)),
    )


@one_blas_thread
def noise_distance(recordings: tuple[Recording, ...]) -> float | None:
    """Mean distance (m) between recorded and true place of a marker by tracking noise; None where it is not known.

    Noise is what does not repeat with the beat. A fit of the mean beat removes more of slow noise than of white noise;
    the scatter is corrected for that. The mean length of a normal vector is 2 sqrt(2 / pi) R_G of its variances, with
    Carlson's symmetric elliptic integral R_G.
    """
    total, count = 0.0, 0
    for recording in recordings:
        try:
            scatter = _Scatter.of(recording, whole_markers(recording))
        except ValueError:
            continue
        number = scatter.valid.sum(axis=0)[::3]
        lengths = 2.0 * np.sqrt(2.0 / np.pi) * elliprg(*scatter.variance.reshape(-1, 3).T)
        total, count = total + float(lengths @ number), count + int(number.sum())
    return total / count if count else None


def whole_markers(recording: Recording) -> Mask:
    """True [T, C] where all of x, y and z of a marker were recorded."""
    return np.repeat(np.isfinite(recording.positions).all(axis=2), 3, axis=1)


@dataclass(frozen=True)
class _Scatter:
    """The part of a recording that does not repeat with the beat.

    Attributes:
        values: [T, C] recorded minus mean beat, zero where not valid.
        valid: [T, C] samples of channels that move and have enough of them.
        basis: [T, P] mean, harmonics and trends, with their ``order`` [P]; ``trend`` [P] marks the trends.
        beats: whole beats, apparent ones under a strobe.
        inner: [C, P, P], (A^T A)^-1 of each channel's fit.
        density: of the noise at each harmonic, relative to the scale [C] of each channel.
        variance: [C] of a sample's noise.
    """

    values: Array
    valid: Mask
    basis: Array
    order: Index
    trend: Mask
    beats: int
    inner: Array
    density: tuple[Array, Array]
    variance: Array

    @classmethod
    def of(cls, recording: Recording, compared: Mask | None) -> _Scatter:
        """ValueError where the recording has no beat of samples, or no channel with enough of them."""
        advance, number = _apparent(recording)
        harmonics, beats = _harmonics(recording, advance), int(advance * (number[-1] + 1) + 0.05)
        basis, order, trend = _basis(recording, harmonics, beats)
        valid = recording.valid if compared is None else recording.valid & compared
        _check_moves(recording, valid)
        valid = valid & ~_still(recording)
        inner, used = _inner(basis, valid)
        if not used.any():
            raise ValueError(_too_few(recording.name, basis.shape[1], valid))
        valid = valid & used
        recorded = np.where(valid, recording.values, 0.0)
        # Trends stay in the scatter: noise that they take up would be missed.
        values = scatter_about(basis[:, ~trend], recorded, valid)
        density = density_at_harmonics(values, valid, advance, number, harmonics, beats)
        taken = density[1] * density[0][order[~trend]].sum()  # by the fit of the mean beat
        variance = ((values**2).sum(axis=0) + taken) / np.maximum(valid.sum(axis=0), 1)
        return cls(values, valid, basis, order, trend, beats, inner, density, variance)


def _check_moves(recording: Recording, seen: Mask) -> None:
    """ValueError where every channel holds one and the same value throughout."""
    least, most = (
        end(np.where(seen, recording.values, none), axis=0) for end, none in ((np.min, np.inf), (np.max, -np.inf))
    )
    if seen.any() and not (most > least).any():
        raise ValueError(
            f"recording {recording.name!r}: nothing moves, each channel holds one value in all {len(seen)} samples; "
            "check its export, or leave the recording out"
        )


def still_markers(recording: Recording) -> tuple[str, ...]:
    """Names of markers with one constant position: they were not tracked, and are not used."""
    still = _still(recording)
    return tuple(name for k, name in enumerate(recording.markers) if still[3 * k])


def _still(recording: Recording) -> Mask:
    """Channels [C] of markers none of whose coordinates ever changes."""
    if recording.kind != "tracks":
        return np.zeros(recording.values.shape[1], bool)
    places, known = recording.positions, np.isfinite(recording.positions)
    last, first = np.where(known, places, -np.inf).max(axis=0), np.where(known, places, np.inf).min(axis=0)
    return np.repeat((first == last).all(axis=1), 3)


def _apparent(recording: Recording) -> tuple[float, Index]:
    """Apparent advance of the phase from sample to sample (beats, at most 0.5), and the number [T] of each sample.

    A strobe slightly slower than the wing makes the beat appear to advance slowly.
    """
    times = recording.times
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    if step <= 0.0:
        raise ValueError(
            f"recording {recording.name!r} has {len(times)} samples, {step:.3g} s apart (median); a diagnosis needs a "
            "beat of samples at growing times: check its time column, or leave the recording out"
        )
    true = step * recording.condition.flap_frequency
    return abs(true - round(true)), np.round((times - times[0]) / step).astype(np.int64)


def _harmonics(recording: Recording, advance: float) -> int:
    """Number of harmonics of the beat to fit; ValueError where the samples determine none."""
    most = HARMONICS
    if recording.kind == "forces":
        most = HARMONICS_OF_FORCES
        if recording.low_pass is not None:
            passed = PASSED * recording.low_pass.cutoff / recording.condition.flap_frequency
            most = max(2, min(most, int(np.ceil(passed))))
    limit = int(0.45 / advance) if advance > 1e-6 else 0
    spare = SPARE if advance * len(recording.times) >= 2 else 2.0
    found = min(most, limit, int((len(recording.times) / spare - 1 - TRENDS) // 2))
    if found < 1:
        raise ValueError(
            f"recording {recording.name!r}: {len(recording.times)} samples, each {advance:.3g} beats further, "
            "determine no harmonic of the beat; record at least ten phases of it, or leave the recording out"
        )
    return found


def _basis(recording: Recording, harmonics: int, beats: int) -> tuple[Array, Index, Mask]:
    psi = 2 * np.pi * recording.condition.flap_frequency * recording.times
    k = np.arange(1, harmonics + 1)
    slow = np.linspace(-1.0, 1.0, len(psi)) if len(psi) > 1 else np.zeros(1)
    trends = [slow, slow * np.cos(psi), slow * np.sin(psi)] if beats >= 2 else []  # within a beat they look like it
    order = np.concatenate([[0], k, k, [0, 1, 1][: len(trends)]]).astype(np.int64)
    return np.column_stack([fourier_basis(psi, harmonics), *trends]), order, np.arange(len(order)) > 2 * harmonics


def _inner(basis: Array, valid: Mask) -> tuple[Array, Mask]:
    """(A^T A)^-1 [C, P, P] over the valid samples of each channel, and which channels determine all coefficients."""
    inner, used = np.zeros((valid.shape[1], basis.shape[1], basis.shape[1])), np.zeros(valid.shape[1], bool)
    masks, group = np.unique(valid, axis=1, return_inverse=True)
    for k, mask in enumerate(masks.T):
        gram = basis[mask].T @ basis[mask]
        if mask.sum() < SPARE * basis.shape[1] or np.linalg.cond(gram) > 1e8:
            continue
        found = np.linalg.inv(gram)
        same = group.ravel() == k
        inner[same], used[same] = found, (np.diag(found) * np.diag(gram)).max() <= INFLATED
    return inner, used


def _too_few(name: str, size: int, valid: Mask) -> str:
    return (
        f"recording {name!r}: no channel has {int(np.ceil(SPARE * size))} samples spread over the beat without "
        f"long gaps, which its {size} coefficients need; the fullest has {int(valid.sum(axis=0).max(initial=0))}: "
        "record more frames, or leave the recording out"
    )
