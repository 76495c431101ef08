"""Errors of the described rest positions of markers and of the frame, integrated out of every residual's coefficients.

No one measures by hand where a marker lies on a wing as well as cameras see it. Such errors are nuisances with a normal
prior. The coefficients v of a residual then have the covariance D^2 + A A^T: D^2 is the variance of the noise, and a
column of A the change by an error of one standard deviation, a vector that turns with the wing. D (1 + D^-1 A A^T
D^-1)^-1/2 D^-1 v has the covariance D^2 of the noise alone; wherever a diagnosis speaks of the coefficients of a
residual, it means these (Rasmussen and Williams 2006, Sec. 2.7: explicit basis functions with a normal prior).

That of a frame is stated with the dataset. That of rest positions is measured: missing physics displaces neighbours
alike, errors of single markers do not. For the same reason the part of the errors that moves all markers as a rigid
wing is not integrated out: it would hide cameras that shifted or an axis that is displaced. Genes adapt to it, and it
is part of their intervals (:mod:`.intervals`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from wingfit.diagnosis.evidence.fit import Fit
from wingfit.diagnosis.evidence.frame_error import changes_by_frame, deviations, moved_by_frame
from wingfit.diagnosis.evidence.screen import Nuisance
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.subject import BeatSubject
from wingfit.inference.marginal import Marginal
from wingfit.inference.noise.harmonic import HarmonicFit
from wingfit.records import FrameError, Recording
from wingfit.records.array_types import Array, Bool, Float, Mask
from wingfit.sim.effects.ports.markers import tangents

PHASES = 72  # instants of a beat at which the wing's axes at a marker are computed
LARGEST = 0.01  # m, standard deviation of a prior that hardly limits the errors
SHOWN = 0.1  # of that prior's variance: an error of larger variance is not measured
MARKERS_PER_TERM = 4  # least number of markers for each term of the polynomial that describes what neighbours share
MAX_CELLS = 60_000_000  # of the matrix of changes, 480 MB: 49 markers in 140 recordings, 180 in 10
BY_CHANCE = 0.01  # probability that any marker's error is so much larger than the others'
RIGID_TERMS = 3  # of the displacement of a rigid wing along an axis: constant, and linear in both directions
LEAST_MARKERS = 12  # with fewer, the polynomial does not have what a rigid wing shares
MAX_DEGREE = 3  # of that polynomial in both directions of the wing
ROBUST_STEPS, HUBER = 20, 1.5  # of its fit, and beyond how many standard deviations an error counts less
NORMAL_MAD = 1.4826  # standard deviation divided by median absolute deviation, of a normal distribution


@dataclass(frozen=True)
class PositionErrors:
    """Errors of rest positions of ``markers``, with the standard deviation ``sd`` (m) along each axis, and of a frame.

    ``usual`` [M]: False for markers with a far larger error, which is not estimated. ``sd`` is zero where errors of
    rest positions are negligible; ``frame`` is None where none is stated.
    """

    markers: tuple[str, ...]
    sd: float
    usual: Bool[Mask, " M"]
    frame: FrameError | None = None

    @property
    def shared(self) -> float:
        """Root mean square (m) along an axis of what a rigid motion of the wing shares with the errors of markers."""
        return self.sd * float(np.sqrt(RIGID_TERMS / self.usual.sum()))

    def estimates(self, data: WhitenedData, fit: Fit) -> Estimates:
        """Return the errors that are estimated at ``fit``; ``data``: with these errors integrated out."""
        found = np.zeros(0) if data.errors is None else data.errors.estimates(data.whiten(fit.coefficients))
        own = found[: 3 * len(self.markers)] if self.sd and len(found) else np.zeros(3 * len(self.markers))
        turned = deviations(self.frame) * found[-6:] if self.frame and len(found) else np.zeros(6)
        return Estimates(self.sd * own.reshape(-1, 3), turned)

    def corrected(
        self, subject: BeatSubject, data: WhitenedData, residuals: Sequence[Array], errors: Estimates
    ) -> tuple[Array, ...]:
        """Return ``residuals`` [T, C] of the recordings of ``data`` without what ``errors`` contribute to them."""
        places, found = {name: k for k, name in enumerate(self.markers)}, []
        for recording, beat_fit, residual in zip(data.beat_recordings, data.beat_fits, residuals, strict=True):
            psi = 2 * np.pi * recording.condition.flap_frequency * recording.times
            moved = moved_by_frame(beat_fit, psi, errors.frame)
            if self.sd:
                turning = axes_at_markers(subject, recording, beat_fit, residual)
                own = np.array([errors.rest[places[m]] if m in places else np.zeros(3) for m in recording.markers])
                series = np.einsum("ma,makp->mkp", own, turning).reshape(-1, turning.shape[-1])
                moved = moved + beat_fit.waves(psi) @ series.T
            found.append(residual - moved)
        return tuple(found)


@dataclass(frozen=True)
class Estimates:
    """Estimated errors.

    Attributes:
        rest: [M, 3] described minus true rest positions of the markers (m, axes of the wing).
        frame: [6] rotations about x, y, z (rad) and shifts along them (m), by which simulated positions are too far.
    """

    rest: Float[Array, "M 3"]
    frame: Float[Array, " 6"]


def axes_at_markers(
    subject: BeatSubject, recording: Recording, beat_fit: HarmonicFit, residual: Float[Array, "T C"]
) -> Float[Array, "M 3 3 P"]:
    """Return Fourier coefficients of the wing's three axes at each of M markers, each a vector, over the beat.

    The last axes are the axis of the wing, the coordinate, and the P coefficients of ``beat_fit``. They are those of
    the simulated motion, with the ``residual`` (m): tangents and normal at the marker, zero if that was not used.
    """
    places = subject.channel_locations(recording)[::3]
    used = beat_fit.used.reshape(-1, 3).all(axis=1)
    rest = np.array([(one.x, one.y) for one in places], float)[used]
    motion = (beat_fit.coefficients + beat_fit.of(residual)).reshape(len(places), 3, -1)[used]
    grid = beat_fit.waves(2 * np.pi * np.arange(PHASES) / PHASES)
    beat = np.einsum("np,mkp->nmk", grid, motion)
    length = float(np.ptp(rest, axis=0).max()) if len(rest) else 0.0
    found = np.zeros((len(places), 3, 3, grid.shape[1]))
    if not length > 0.0:
        return found
    periodic = np.linalg.pinv(grid)
    for k, m in enumerate(np.flatnonzero(used)):
        along, across = np.einsum("am,nmk->ank", tangents(rest, k, length), beat)
        normal = np.cross(along, across)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        found[m] = np.einsum("pn,ank->akp", periodic, np.stack([along, across, normal]))
    return found


def changes_by_errors(
    subject: BeatSubject, data: WhitenedData, residuals: Sequence[Float[Array, "T C"]], markers: Sequence[str]
) -> Float[Array, "D K"]:
    """Return the changes of the coefficients [D] by a metre of each rest position of M ``markers``, K = 3 M."""
    places, rows = {name: k for k, name in enumerate(markers)}, []
    for recording, beat_fit, residual in zip(data.beat_recordings, data.beat_fits, residuals, strict=True):
        turning = axes_at_markers(subject, recording, beat_fit, residual)
        found = np.zeros((len(turning), 3, turning.shape[-1], len(markers), 3))
        for m, name in enumerate(recording.markers):
            found[m, :, :, places[name]] = np.moveaxis(turning[m], 0, -1)
        rows.append(found.reshape(-1, turning.shape[-1], 3 * len(markers))[beat_fit.used].reshape(-1, 3 * len(markers)))
    return np.concatenate(rows)


def find_position_errors(
    subject: BeatSubject, data: WhitenedData, nominal: Fit, frame: FrameError | None = None
) -> tuple[PositionErrors, WhitenedData] | None:
    """Measure the errors of rest positions at the fit ``nominal``, and integrate them out of the coefficients.

    Those of the ``frame`` are integrated out too, as stated. A marker with a far larger error than others is excepted:
    it slipped, or was confused with another. Errors of rest positions are zero where they are negligible compared with
    the noise of a sample, where few markers show nothing, or where there are too many for the memory. None where there
    are no errors at all.
    """
    markers = tuple(dict.fromkeys(name for one in data.beat_recordings for name in one.markers))
    found, columns = PositionErrors(markers, 0.0, np.ones(len(markers), bool), frame), list[Array]()
    rigid = np.zeros((len(data.scale), 0))
    if frame is not None:
        columns.append(changes_by_frame(data) * deviations(frame))
    places = {p.name: (p.x, p.y) for one in data.beat_recordings for p in subject.channel_locations(one)}
    rest = np.array([places[name] for name in markers], float)
    if len(markers) >= LEAST_MARKERS and np.ptp(rest, axis=0).max() > 0.0 and not too_many(data):
        changes = changes_by_errors(subject, data, nominal.residuals, markers)
        sd, usual = _standard_deviation(data, nominal, changes, rest)
        if sd >= data.policy.negligible * data.noise:
            found = replace(found, sd=sd, usual=usual)
            columns.insert(0, _own(changes, rest, usual) * sd)
            rigid = _rigid(changes, rest, usual) * sd
    if not columns:
        return None
    return found, data.allowing(Marginal.of(data.whitened_slopes(np.hstack(columns))), rigid)


def too_many(data: WhitenedData) -> bool:
    """Return whether the markers are too many for the memory, so that their errors are not measured."""
    markers = {name for one in data.beat_recordings for name in one.markers}
    return 3 * len(markers) * len(data.scale) > MAX_CELLS


def _own(changes: Float[Array, "D K"], rest: Float[Array, "M 2"], usual: Bool[Mask, " M"]) -> Float[Array, "D K"]:
    """Return ``changes`` without what moves the ``usual`` markers as a rigid wing: a fault, not errors of single ones.

    Zero for the other markers.
    """
    rigid = _rigid_motions(rest, usual)
    by_marker = changes.reshape(len(changes), -1, 3)[:, usual]
    found = np.zeros((len(changes), len(rest), 3))
    found[:, usual] = by_marker - np.einsum("mq,nq,dna->dma", rigid, rigid, by_marker, optimize=True)
    return np.asarray(found.reshape(changes.shape))


def _rigid(changes: Float[Array, "D K"], rest: Float[Array, "M 2"], usual: Bool[Mask, " M"]) -> Float[Array, "D 9"]:
    """Return the ``changes`` by errors of the ``usual`` markers that :func:`_own` leaves out, one motion a column.

    Errors of unit variance, independent from marker to marker, have these nine components, of unit variance and
    independent, as the motions are orthonormal.
    """
    by_marker = changes.reshape(len(changes), -1, 3)[:, usual]
    found = np.einsum("mq,dma->dqa", _rigid_motions(rest, usual), by_marker, optimize=True)
    return np.asarray(found.reshape(len(changes), -1))


def _rigid_motions(rest: Float[Array, "M 2"], usual: Bool[Mask, " M"]) -> Float[Array, "U 3"]:
    """Return orthonormal displacements [U, 3] of the U ``usual`` markers along an axis: constant and linear."""
    return np.asarray(np.linalg.qr(_polynomial(rest[usual], 1))[0])


def _standard_deviation(
    data: WhitenedData, nominal: Fit, changes: Float[Array, "D K"], rest: Float[Array, "M 2"]
) -> tuple[float, Bool[Mask, " M"]]:
    """Return the standard deviation (m) of the errors beyond what neighbours share, and which markers have usual ones.

    Zero where the markers are too few.
    """
    nuisance = Nuisance(data, nominal)
    fields = nuisance.project_out(changes.T)
    covariance = np.linalg.inv(fields @ fields.T + np.eye(len(fields)) / LARGEST**2)
    errors, variance = (covariance @ (fields @ nuisance.residual)).reshape(-1, 3), np.diag(covariance).reshape(-1, 3)
    shown = (variance < SHOWN * LARGEST**2).all(axis=1)
    errors, variance, rest, usual = errors[shown], variance[shown], rest[shown], np.ones(len(rest), bool)
    degree = max((d for d in range(MAX_DEGREE + 1) if MARKERS_PER_TERM * len(_powers(d)) <= len(rest)), default=None)
    if degree is None or len(rest) < LEAST_MARKERS:
        return 0.0, usual
    shared = _polynomial(rest, degree)
    own = np.stack([_beyond(shared, one) for one in errors.T], axis=1)
    spread = NORMAL_MAD * float(np.median(np.abs(own))) * np.sqrt(len(rest) / (len(rest) - shared.shape[1]))
    near = (own**2).sum(axis=1) < scipy.special.chdtri(3, BY_CHANCE / len(rest)) * spread**2
    usual[shown] = near
    if not near.any():
        return 0.0, usual
    mean_square = float(np.mean(own[near] ** 2)) * len(rest) / (len(rest) - shared.shape[1])
    return float(np.sqrt(max(mean_square - float(np.mean(variance)), 0.0))), usual


def _polynomial(rest: Float[Array, "M 2"], degree: int) -> Float[Array, "M Q"]:
    """Return all products [M, Q] of powers of the coordinates ``rest`` [M, 2] up to ``degree``."""
    place = (rest - rest.mean(axis=0)) / np.ptp(rest, axis=0).max()
    return np.stack([place[:, 0] ** i * place[:, 1] ** j for i, j in _powers(degree)], axis=1)


def _powers(degree: int) -> list[tuple[int, int]]:
    return [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]


def _beyond(shared: Float[Array, "M Q"], values: Float[Array, " M"]) -> Float[Array, " M"]:
    """Return ``values`` [M] minus their robust fit by the columns of ``shared`` [M, Q] (Huber 1964)."""
    weight = np.ones(len(values))
    for _ in range(ROBUST_STEPS):
        left = values - shared @ np.linalg.lstsq(shared * weight[:, None], values * weight, rcond=None)[0]
        scale = NORMAL_MAD * float(np.median(np.abs(left)))
        weight = np.sqrt(np.minimum(1.0, HUBER * scale / np.maximum(np.abs(left), 1e-300)))
    return np.asarray(left)
