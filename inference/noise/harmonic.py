"""A recording as Fourier coefficients of its beat, with the noise of these coefficients from differences between beats.

The motion of a model is periodic, so all its predictions lie in the harmonics of the beat; whatever lies between the
harmonics is noise (or a fault that is not periodic). Each channel is reduced to its mean, the harmonics up to H, and
three slow trends in which drifts and wrong rates are visible: a linear change of the mean, and of the first harmonic in
phase and in quadrature. The noise at a harmonic is estimated from the spectrum between the harmonics, whatever its
colour.

Under a strobe, consecutive frames show nearly the same phase of different beats, so that the wing seems to flap slowly:
the *apparent* beat. Noise is correlated from frame to frame, therefore spectra are computed over the apparent phase.
For a camera much faster than the wing, apparent and true beat are the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import elliprg

from wingfit.inference.noise.changes.drift import Drift, drift_of, slow_basis
from wingfit.inference.noise.changes.modulation import Modulation, Sampled, modulation_of
from wingfit.inference.noise.mean_beat import fourier_basis, masks_of, scatter_about
from wingfit.inference.noise.shared_pattern import shared_part
from wingfit.inference.noise.spectrum import density_at_harmonics, lag1_autocorrelation
from wingfit.inference.noise.stated import Stated, correlation_matrices, stated_noise
from wingfit.records import Recording
from wingfit.records.array_types import Array, Bool, Float, Index, Int, Mask
from wingfit.records.blas_threads import one_blas_thread

HARMONICS = 8  # of tracks: a wing of membrane and foam does not move faster
HARMONICS_OF_FORCES = 10
PASSED = 1.6  # frequency, in cut-off frequencies of a low-pass, above which nothing of a force remains
TRENDS = 3
SPARE = 1.5  # least number of samples per coefficient; a channel with fewer is not used
INFLATED = 5.0  # largest ratio of a coefficient's variance to its variance if fitted alone: more means long gaps

# Root mean square of a drift, in ranges of the channels, below which it counts as none: interpolation and filters make
# as much of it in simulations without noise. It is that of an amplitude that changes by half a per cent.
LEAST_DRIFT = 5e-4


@dataclass(frozen=True)
class HarmonicFit:
    """Linear map from the samples [T, C] of a recording to P Fourier coefficients per channel, and their noise.

    Attributes:
        order: [P] harmonic of each coefficient; 0 for the mean.
        trend: [P], True for coefficients of slow trends.
        weight: [P] mean square over the samples of the basis function of each coefficient.
        inverse: [C, P, T] least-squares map from samples to coefficients; zero for samples that are not used.
        used: [C], False for a channel with too few samples.
        variance: [C, P] of the noise of the coefficients.
        noise: [C] standard deviation of the noise of one sample.
        lag1: correlation of the noise of successive samples, median of the channels.
        between_beats: True if the noise was estimated from differences between beats; False, for a recording of less
            than two beats, if it was estimated from the part of the spectrum above the fitted harmonics.
        coefficients: [C, P] of the recording itself.
        drift: slow change of the beat during the recording; None for too few beats.
        shared: part of the power of the noise that is a motion that markers of tracks share (:func:`shared_part`).
        stated: the stated noise compared with what was seen; None if none is stated.
        correlation: [M, 3, 3] of the noise of each marker's coordinates, as stated; None: it is independent.
        modulation: periodic change of the beat; None for too few beats.
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
    drift: Drift | None = None
    shared: float = 0.0
    stated: Stated | None = None
    correlation: Float[Array, "M 3 3"] | None = None
    modulation: Modulation | None = None

    def of(self, residuals: Float[Array, "*B T C"]) -> Float[Array, "*B C P"]:
        """Fourier coefficients [..., C, P] of ``residuals`` [..., T, C] (NaN: not recorded); zero if not used."""
        filled = np.where(np.isfinite(residuals), residuals, 0.0)
        channels = np.moveaxis(filled, -1, 0).reshape(len(self.inverse), -1, filled.shape[-2])
        found = np.einsum("cbt,cpt->bcp", channels, self.inverse, optimize=True)
        return np.asarray(found.reshape(*residuals.shape[:-2], *self.variance.shape))

    def waves(self, psi: Float[Array, " N"]) -> Float[Array, "N P"]:
        """Return the basis function [N, P] of each of P coefficients at phases ``psi`` [N] (rad); 0 for slow trends."""
        found = np.zeros((len(psi), len(self.order)))
        found[:, ~self.trend] = fourier_basis(psi, int(self.order[~self.trend].max()))
        return found


def harmonic_fit(recording: Recording, compared: Mask | None = None) -> HarmonicFit:
    """Reduce ``recording`` to the Fourier coefficients of its beat and estimate their noise.

    ``compared`` [T, C]: True for samples to use; None: all that were recorded. ValueError if no channel has enough
    samples, if no channel moves, or if all samples have the same phase.
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
        scatter.drift,
        shared_part(scatter.values, valid, recording.values) if recording.kind == "tracks" else 0.0,
        scatter.stated,
        scatter.correlation,
        scatter.modulation,
    )


def changes_and_noise(
    recording: Recording, compared: Mask | None = None
) -> tuple[Drift | None, Modulation | None, float]:
    """Return drift and modulation of ``recording``, and the root mean square of the noise of its samples (m or N).

    The same as of :func:`harmonic_fit`, for less time and memory; ``compared`` [T, C] and ValueError as there.
    """
    scatter = _Scatter.of(recording, compared)
    noise = float(np.sqrt(np.mean(scatter.variance[scatter.valid.any(axis=0)])))
    return scatter.drift, scatter.modulation, noise


@one_blas_thread
def noise_distance(recordings: tuple[Recording, ...]) -> float | None:
    """Estimate the mean distance (m) between the recorded and the true positions of markers that tracking noise causes.

    Noise is the part of the positions that differs from beat to beat; the part of it that the fitted mean beat absorbs
    is added again. Returns None if no recording has usable samples. The mean length of a normally distributed vector is
    2 sqrt(2 / pi) R_G of its three principal variances, with Carlson's symmetric elliptic integral R_G.
    """
    total, count = 0.0, 0
    for recording in recordings:
        try:
            scatter = _Scatter.of(recording, whole_markers(recording))
        except ValueError:
            continue
        number = scatter.valid.sum(axis=0)[::3]
        lengths = 2.0 * np.sqrt(2.0 / np.pi) * elliprg(*scatter.principal_variances.T)
        total, count = total + float(lengths @ number), count + int(number.sum())
    return total / count if count else None


def whole_markers(recording: Recording) -> Mask:
    """True [T, C] (C: x, y, z of each marker in turn) where all three coordinates of the marker were recorded."""
    return np.repeat(np.isfinite(recording.positions).all(axis=2), 3, axis=1)


@dataclass(frozen=True)
class _Scatter:
    """The part of a recording that differs from beat to beat: recorded values minus the fitted mean beat.

    T samples, C channels, P basis functions (mean, harmonics, trends), H harmonics.

    Attributes:
        values: [T, C] recorded values minus mean beat, drift and modulation, if found; zero where not valid.
        valid: [T, C], True for the samples used: of channels that move and have enough samples.
        basis: [T, P] basis functions at the samples.
        order: [P] harmonic of each basis function; 0 for the mean.
        trend: [P], True for basis functions that are slow trends.
        beats: number of whole beats, apparent ones under a strobe.
        inner: [C, P, P], (A^T A)^-1 of the least-squares fit of each channel, A its valid rows of the basis.
        density: relative spectral density of the noise at harmonics 0 .. H, [H + 1], and the scale [C] of each channel
        (a variance) by which it is multiplied.
        variance: [C] of the noise of one sample.
        drift: slow change of the beat; None for too few beats.
        modulation: periodic change of the beat; None for too few beats.
        stated: the stated noise compared with what was seen; None if none is stated.
        correlation: [M, 3, 3] of the noise of each marker's coordinates, as stated; None: it is independent.
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
    drift: Drift | None
    modulation: Modulation | None
    stated: Stated | None
    correlation: Array | None

    @classmethod
    def of(cls, recording: Recording, compared: Mask | None) -> _Scatter:
        """Subtract the mean beat from ``recording`` and estimate the noise from the rest.

        ``compared`` [T, C]: True for samples to use; None: all recorded ones. ValueError if the samples determine no
        harmonic of the beat, or if no channel moves or has enough samples.
        """
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
        # Trends are not subtracted: they would absorb some of the noise.
        columns, fitted = basis[:, ~trend], order[~trend]
        values, spare = scatter_about(columns, recorded, valid), int(valid.sum(axis=0)[used].min())
        apparent = advance * number.astype(float)
        least, widened = LEAST_DRIFT * _ranges(recorded, valid), np.ones(harmonics + 1)
        # What is found to change is not noise.
        sampled = Sampled.of(recording, recorded - values, apparent, number, harmonics, beats)
        psi = sampled.psi
        modulation, removed = modulation_of(values, valid, sampled, least), np.zeros(0)
        if modulation and modulation.found:
            orders = sampled.all_orders(modulation.rate)
            both = np.hstack([columns, sampled.waves(orders)])
            if SPARE * both.shape[1] <= spare:
                columns, values = both, scatter_about(both, recorded, valid)
                fitted = np.concatenate([fitted, np.repeat(np.minimum(orders, harmonics).astype(np.int64), 2)])
                removed = sampled.appearing(orders) / advance
        drift = drift_of(values, valid, psi, apparent, harmonics, beats, least)
        if drift and drift.found:  # what it is, the trends show
            slow, of = slow_basis(psi, apparent, beats, harmonics)
            columns = np.hstack([columns, slow])
            if SPARE * columns.shape[1] <= spare:
                widened[: of.max() + 1] *= (beats - 1.0) / (beats - 1.0 - (of == 0).sum())  # noise that is removed too
                values, fitted = scatter_about(columns, recorded, valid), np.concatenate([fitted, of])
        density, scale = density_at_harmonics(values, valid, advance, number, harmonics, beats, removed)
        density *= widened
        taken = scale * density[fitted].sum()  # power of the noise that the fit of the mean beat absorbs
        variance = ((values**2).sum(axis=0) + taken) / np.maximum(valid.sum(axis=0), 1)
        stated = stated_noise(recording, variance, used, values, between_beats=beats >= 2)
        if stated and stated.used and recording.standard_deviation is not None:
            # All channels have one spectrum; how large each of them is, is stated, and need not be estimated.
            whole = float(np.mean(scale[used]) / np.mean(variance[used]))
            variance = recording.standard_deviation**2
            scale = whole * variance
        known = recording.noise_correlation if stated and stated.correlated else None
        correlation = None if known is None else correlation_matrices(known)
        noise, changes = (density, scale), (drift, modulation)
        return cls(values, valid, basis, order, trend, beats, inner, noise, variance, *changes, stated, correlation)

    @property
    def principal_variances(self) -> Float[Array, "M 3"]:
        """Variances [M, 3] of the noise of each marker's sample along its principal axes, m^2."""
        found = self.variance.reshape(-1, 3)
        if self.correlation is None:
            return found
        spread = np.sqrt(found)
        square = np.linalg.eigvalsh(spread[:, :, None] * self.correlation * spread[:, None, :])
        return np.asarray(np.maximum(square, 0.0))


def _check_moves(recording: Recording, seen: Mask) -> None:
    """ValueError if every channel has the same value in all of its samples; ``seen`` [T, C]: samples to use."""
    least, most = (
        end(np.where(seen, recording.values, none), axis=0) for end, none in ((np.min, np.inf), (np.max, -np.inf))
    )
    if seen.any() and not (most > least).any():
        raise ValueError(
            f"recording {recording.name!r}: nothing moves, each channel holds one value in all {len(seen)} samples; "
            "check its export, or leave the recording out"
        )


def _ranges(recorded: Array, valid: Mask) -> float:
    """Root mean square over all channels of the range, largest minus smallest ``valid`` [T, C] value (m or N)."""
    most, least = np.where(valid, recorded, -np.inf).max(axis=0), np.where(valid, recorded, np.inf).min(axis=0)
    used = valid.any(axis=0)
    return float(np.sqrt(np.mean((most[used] - least[used]) ** 2)))


def still_markers(recording: Recording) -> tuple[str, ...]:
    """Names of markers whose recorded position never changes: they were not tracked, and are not used."""
    still = _still(recording)
    return tuple(name for k, name in enumerate(recording.markers) if still[3 * k])


def _still(recording: Recording) -> Mask:
    """True [C] for the channels of markers whose recorded position never changes; all False for forces."""
    if recording.kind != "tracks":
        return np.zeros(recording.values.shape[1], bool)
    places, known = recording.positions, np.isfinite(recording.positions)
    last, first = np.where(known, places, -np.inf).max(axis=0), np.where(known, places, np.inf).min(axis=0)
    return np.repeat((first == last).all(axis=1), 3)


def _apparent(recording: Recording) -> tuple[float, Index]:
    """Return the advance of the apparent beat per sample (beats, 0 to 0.5), and the index [T] of each sample.

    The index counts median sampling intervals from the first sample. A strobe slightly slower than the wing makes the
    beat appear to advance slowly. ValueError if there are fewer than two samples or their times do not increase.
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
    """Number of harmonics of the beat to fit; ValueError if the samples do not determine any.

    ``advance``: apparent advance of the beat per sample, in beats.
    """
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
    trends = [slow, slow * np.cos(psi), slow * np.sin(psi)] if beats >= 2 else []  # within one beat, trends resemble it
    order = np.concatenate([[0], k, k, [0, 1, 1][: len(trends)]]).astype(np.int64)
    return np.column_stack([fourier_basis(psi, harmonics), *trends]), order, np.arange(len(order)) > 2 * harmonics


def _inner(basis: Array, valid: Mask) -> tuple[Array, Mask]:
    """Return (A^T A)^-1 [C, P, P] of the least-squares fit of each channel, and True [C] where a channel can be used.

    A: the rows of ``basis`` [T, P] that are ``valid`` [T, C] for the channel. A channel is used if it has enough
    samples, without long gaps in the beat.
    """
    inner, used = np.zeros((valid.shape[1], basis.shape[1], basis.shape[1])), np.zeros(valid.shape[1], bool)
    for mask, same in masks_of(valid):
        gram = basis[mask].T @ basis[mask]
        if mask.sum() < SPARE * basis.shape[1] or np.linalg.cond(gram) > 1e8:
            continue
        found = np.linalg.inv(gram)
        inner[same], used[same] = found, (np.diag(found) * np.diag(gram)).max() <= INFLATED
    return inner, used


def _too_few(name: str, size: int, valid: Mask) -> str:
    return (
        f"recording {name!r}: no channel has {int(np.ceil(SPARE * size))} samples spread over the beat without "
        f"long gaps, which its {size} coefficients need; the fullest has {int(valid.sum(axis=0).max(initial=0))}: "
        "record more frames, or leave the recording out"
    )
