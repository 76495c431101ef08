"""A recording as the Fourier coefficients of its beat, with the noise of each, known from the scatter between beats.

A model's motion is periodic, so all that it can say about a recording lies in the harmonics of the beat; all that is
between the harmonics is noise (or a fault that is not periodic). So each channel is reduced to the mean, the
harmonics up to K, and three slow trends: of the mean, and of the first harmonic (in phase and in quadrature), in which
drifts and wrong rates show. The noise at a harmonic is read off the spectrum between them, whatever its colour.

Frames under a strobe follow each other in the order of the *apparent* beat, and noise is correlated in that order; the
spectrum is taken over apparent phase. A camera that is much faster than the wing is the case without aliasing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize

from wingfit.records import Recording

Array = npt.NDArray[np.float64]

HARMONICS = 8  # of tracks: a wing of mass and foam follows no faster
HARMONICS_OF_FORCES = 10
PASSED = 1.6  # cut-offs of a low-pass: above nothing is left of a force
TRENDS = 3
SPARE = 1.5  # samples per coefficient, at least; a channel with fewer is not looked at
POOLED = 10.0  # lines that the mean scale of all channels counts for in the scale of one
LOCAL = 0.6  # harmonics to either side over which the noise's spectrum is averaged
BLURRED = 5.0  # times the variance that a coefficient would have if no other were fitted: a channel with long gaps
LOWEST = 3  # lines whose power law is taken
STEEPEST = -2.0  # of the power law: a random walk
SEEN_BY_MEAN = 0.35  # lines that the mean of a recording sees noise of 1/f at
FLAT = 0.002  # of the largest: a spectrum is taken to be nowhere lower


@dataclass(frozen=True)
class Beatwise:
    """The map from samples [T, C] of a recording to coefficients [C, P], and their noise.

    Attributes:
        order: [P] harmonic of each coefficient.
        trend: [P], True for slow trends.
        weight: [P] mean square over the samples of a coefficient of one.
        inverse: [C, P, T], least squares over the samples seen; zero where not seen.
        used: [C], False for a channel with too few samples.
        variance: [C, P] of the coefficients' noise.
        noise: [C] standard deviation of a sample's noise.
        memory: correlation of noise from one sample to the next, median of the channels.
        told: whether the scatter between beats told the noise; else what no harmonic explains did.
        coefficients: [C, P] of the recording itself.
    """

    order: npt.NDArray[np.int64]
    trend: npt.NDArray[np.bool_]
    weight: Array
    inverse: Array
    used: npt.NDArray[np.bool_]
    variance: Array
    noise: Array
    memory: float
    told: bool
    coefficients: Array

    def of(self, residuals: Array) -> Array:
        """Coefficients [..., C, P] of residuals [..., T, C], NaN where not recorded; zero for a channel not used."""
        filled = np.where(np.isfinite(residuals), residuals, 0.0)
        channels = np.moveaxis(filled, -1, 0).reshape(len(self.inverse), -1, filled.shape[-2])
        found = np.einsum("cbt,cpt->bcp", channels, self.inverse, optimize=True)
        return np.asarray(found.reshape(*residuals.shape[:-2], *self.variance.shape))


def beatwise(recording: Recording, compared: npt.NDArray[np.bool_] | None = None) -> Beatwise:
    """Reduce ``recording``; ``compared`` [T, C] says which samples count (None: all that were recorded).

    ValueError where no channel has enough samples, or moves, or every sample is from the same phase of the beat.
    """
    seen = recording.valid if compared is None else recording.valid & compared
    advance, place = _apparent(recording)
    kept, beats = _harmonics(recording, advance), int(advance * (place[-1] + 1) + 0.05)
    _check_moves(recording, seen)
    seen = seen & ~_still(recording)
    basis, order, trend = _basis(recording, kept, beats)
    inverse, spread, used = _inverses(basis, seen, recording.name)
    values = np.where(seen, recording.values, 0.0)
    coefficients = np.einsum("cpt,tc->cp", inverse, values)
    periodic, _, _ = _inverses(basis[:, ~trend], seen & used, recording.name)
    mean = basis[:, ~trend] @ np.einsum("cpt,tc->pc", periodic, values)
    left = np.where(seen & used, values - mean, 0.0)  # trends are among the noise: what they take would be missed
    spectrum, scale = _spectrum(left, seen & used, advance, place, kept, beats)
    count = seen.sum(axis=0)
    density = np.array([spectrum[k] for k in order])
    taken = scale * density[~trend].sum()  # by the fit of the mean beat
    return Beatwise(
        order,
        trend,
        np.mean(basis**2, axis=0),
        inverse,
        used,
        spread * scale[:, None] * density,
        np.sqrt(((left**2).sum(axis=0) + taken) / np.maximum(count, 1)),
        _memory(left, seen & used),
        beats >= 2,
        coefficients,
    )


def _check_moves(recording: Recording, seen: npt.NDArray[np.bool_]) -> None:
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
    """Markers that were recorded at one and the same place throughout: they were not tracked, and are not used."""
    still = _still(recording)
    return tuple(name for k, name in enumerate(recording.markers) if still[3 * k])


def _still(recording: Recording) -> npt.NDArray[np.bool_]:
    """Channels [C] of markers none of whose coordinates ever changes."""
    if recording.kind != "tracks":
        return np.zeros(recording.values.shape[1], bool)
    places, known = recording.positions, np.isfinite(recording.positions)
    last, first = np.where(known, places, -np.inf).max(axis=0), np.where(known, places, np.inf).min(axis=0)
    return np.repeat((first == last).all(axis=1), 3)


def _apparent(recording: Recording) -> tuple[float, npt.NDArray[np.int64]]:
    """Apparent advance of the beat from sample to sample (beats, at most half), and the number [T] of each sample."""
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
    """How many harmonics of the beat are looked at."""
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
            f"recording {recording.name!r}: {len(recording.times)} samples, each {advance:.3g} beats further, tell no "
            "harmonic of the beat; record at least ten phases of it, or leave the recording out"
        )
    return found


def _basis(recording: Recording, kept: int, beats: int) -> tuple[Array, npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    psi = 2 * np.pi * recording.condition.flap_frequency * recording.times
    k = np.arange(1, kept + 1)
    slow = np.linspace(-1.0, 1.0, len(psi)) if len(psi) > 1 else np.zeros(1)
    trends = [slow, slow * np.cos(psi), slow * np.sin(psi)] if beats >= 2 else []  # within a beat they look like it
    columns = [np.ones_like(psi), *np.cos(psi[:, None] * k).T, *np.sin(psi[:, None] * k).T, *trends]
    order = np.concatenate([[0], k, k, [0, 1, 1][: len(trends)]]).astype(np.int64)
    return np.stack(columns, axis=1), order, np.arange(len(order)) > 2 * kept


def _inverses(basis: Array, seen: npt.NDArray[np.bool_], name: str) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """Least squares [C, P, T] for each channel, diagonal [C, P] of (A^T A)^-1, and which channels are used."""
    frames, size = basis.shape
    inverse, spread = np.zeros((seen.shape[1], size, frames)), np.zeros((seen.shape[1], size))
    used = seen.sum(axis=0) >= SPARE * size
    known: dict[bytes, tuple[Array, Array] | None] = {}
    for c in np.flatnonzero(used):
        key = seen[:, c].tobytes()
        if key not in known:
            known[key] = _solved(basis, seen[:, c])
        found = known[key]
        if found is None:
            used[c] = False
            continue
        inverse[c], spread[c] = found
    if not used.any():
        raise ValueError(
            f"recording {name!r}: no channel has {int(np.ceil(SPARE * size))} samples spread over the beat without "
            f"long gaps, which its {size} coefficients need; the fullest has {int(seen.sum(axis=0).max())}: record "
            "more frames, or leave the recording out"
        )
    return inverse, spread, used


def _solved(basis: Array, seen: npt.NDArray[np.bool_]) -> tuple[Array, Array] | None:
    part = basis[seen]
    gram = part.T @ part
    if np.linalg.cond(gram) > 1e8:
        return None
    inner = np.linalg.inv(gram)
    if (np.diag(inner) * np.diag(gram)).max() > BLURRED:
        return None
    inverse = np.zeros((basis.shape[1], len(basis)))
    inverse[:, seen] = inner @ part.T
    return inverse, np.diag(inner)


def _spectrum(
    left: Array, seen: npt.NDArray[np.bool_], advance: float, place: npt.NDArray[np.int64], kept: int, beats: int
) -> tuple[Array, Array]:
    """Density of the noise at harmonics 0 .. kept, and the variance of each channel that it is in parts of.

    A line of density s means that a cosine fitted there to N samples has the variance 2 s / N, as of white noise of
    variance s.
    """
    if beats >= 2:
        parts = np.arange(1, beats) / beats
        lines = (np.arange(kept + 1)[:, None] + parts).ravel()
        lines = lines[lines * advance < 0.5]
    else:
        lines = np.arange(kept + 1, max(int(0.5 / advance), kept + 1) + 1).astype(float)
    turn = np.exp(-2j * np.pi * advance * place[:, None] * lines)
    count = np.maximum(seen.sum(axis=0), 1)
    power = np.abs(turn.T @ left) ** 2 / count  # [lines, C]
    used = seen.any(axis=0)
    mean = power[:, used].mean(axis=1)
    scale = np.ones(left.shape[1])
    for _ in range(3):
        shape = mean / max(mean.mean(), 1e-300)
        own = (power / np.maximum(shape, FLAT * shape.max())[:, None]).mean(axis=0)
        common = own[used].mean()
        scale = (len(lines) * own + POOLED * common) / (len(lines) + POOLED)
        mean = (power[:, used] / scale[used]).mean(axis=1)
    scale = np.where(used, scale, 1.0)
    if beats >= 3:
        density = np.array([_near(lines, mean, k) for k in range(kept + 1)])
    else:
        density = _first_order(lines, mean, advance, kept)
    if beats >= 2:
        steep = max(float(density[0]), _at_rest(lines, mean, beats))
        density[0] = np.sqrt(
            density[0] * steep
        )  # between noise that levels off below the lines and noise that does not
    return np.maximum(density, FLAT * density.max()), scale


def _at_rest(lines: Array, mean: Array, beats: int) -> float:
    """Density that the mean of a recording sees, by the power law of the lowest lines.

    Noise such as 1/f has most of its power below the first line between harmonics; there it moves the mean.
    """
    low = np.argsort(lines)[: max(LOWEST, beats - 1)]
    slope = np.polyfit(np.log(lines[low]), np.log(np.maximum(mean[low], 1e-300)), 1)[0]
    middle = float(np.exp(np.mean(np.log(lines[low]))))
    level = float(np.exp(np.mean(np.log(np.maximum(mean[low], 1e-300)))))
    return float(level * (SEEN_BY_MEAN / beats / middle) ** np.clip(slope, STEEPEST, 0.0))


def _near(lines: Array, mean: Array, k: int) -> float:
    near = np.abs(lines - k) <= LOCAL
    return float(mean[near].mean()) if near.any() else float(mean.mean())


def _first_order(lines: Array, mean: Array, advance: float, kept: int) -> Array:
    """Density at the harmonics of first-order autoregressive noise beside white noise, by Whittle's likelihood."""

    def model(x: Array, at: Array) -> Array:
        memory, coloured, white = 0.98 / (1 + np.exp(-x[0])), np.exp(x[1]), np.exp(x[2])
        cosine = np.cos(2 * np.pi * advance * at)
        return np.asarray(coloured * (1 - memory**2) / (1 + memory**2 - 2 * memory * cosine) + white)

    def cost(x: Array) -> float:
        density = model(x, lines)
        return float(np.sum(np.log(density) + mean / density) + 1e-3 * np.sum(x**2))

    level = np.log(max(float(mean.mean()), 1e-300) / 2)
    best = min((minimize(cost, [m, level, level], method="Nelder-Mead") for m in (-1.0, 1.5)), key=lambda r: r.fun)
    return model(best.x, np.arange(kept + 1, dtype=float))


def _memory(left: Array, seen: npt.NDArray[np.bool_]) -> float:
    both = seen[1:] & seen[:-1]
    product = np.where(both, left[1:] * left[:-1], 0.0).sum(axis=0) / np.maximum(both.sum(axis=0), 1)
    own = (left**2).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    good = (own > 0) & both.any(axis=0)
    return float(np.median(product[good] / own[good])) if good.any() else 0.0
