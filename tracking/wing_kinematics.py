"""The motion of a wing from its tracked markers: flap angle zeta(t*) and wing pitch theta_w(t*).

Geometry (Armanini et al. 2016, Eqs. 15, 17-19; docs/tracking.md), in body axes x forward, y right, z down. The wing
rotates about an axis along x. Closed, it is at the angle ``dihedral`` above the horizontal; zeta is the angle from
there, positive as the wing opens: an upper wing towards -z, a lower one towards +z. With n the direction in which the
leading edge moves as the wing opens, the chord from trailing to leading edge is sin(theta_w) x + cos(theta_w) n; pi/2
is a chord along x.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy

from wingfit.records import FourierFlap, FourierPitch, PassivePitch, WingMotion
from wingfit.records.array_types import Array
from wingfit.records.blas_threads import one_blas_thread
from wingfit.tracking.noise import least_squares, products
from wingfit.tracking.smoothing import PeriodicFit, basis, fit_periodic

PitchKind = Literal["fourier", "passive"]
_MIN_BEATS = 1.5
_STILL = 1e-6  # rad: a flap angle with a smaller range does not move
_SIGNIFICANCE = 0.001  # largest p value of an accepted period
_MIN_SAMPLES = 2.5
_MIN_EXPLAINED = 0.8  # of the variance at a given frequency; less causes a remark


@dataclass(frozen=True)
class WingPlace:
    """The wing that carries the markers: ``upper`` or lower, ``right`` or left; ``dihedral`` in rad where known."""

    upper: bool
    right: bool = True
    dihedral: float | None = None


@dataclass(frozen=True, eq=False)
class Angles:
    """Flap angle and wing pitch (rad) [N] at increasing ``times`` [N] in s; NaN where not seen."""

    times: Array
    flap: Array
    pitch: Array | None = None
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Frequency:
    """Flap frequency and its standard error, Hz (error None where the user gave the frequency)."""

    hertz: float
    error: float | None = None


@dataclass(frozen=True, eq=False)
class PitchLaw:
    """Law of wing pitch (Armanini et al. 2016, Eq. 17) fitted to measured pitch.

    ``errors`` [4] are the standard errors of the fields of ``pitch`` in their order, ``correlation`` [4, 4] that of the
    errors. ``misfit`` is the RMS difference from the measured pitch, rad.
    """

    pitch: PassivePitch
    errors: Array
    correlation: Array
    misfit: float


@dataclass(frozen=True, eq=False)
class WingKinematics:
    """Estimated motion of a wing over its beat, the Fourier series on which it is based, and remarks.

    ``angles`` are those to which the series were fitted, the flap angle counted from the closed position.
    ``start`` is a time (s, clock of the recording) at which a beat starts; ``start_error`` its standard error.
    """

    motion: WingMotion
    angles: Angles
    flap: PeriodicFit
    pitch: PeriodicFit
    law: PitchLaw | None
    frequency: Frequency
    start: float
    start_error: float
    remarks: tuple[str, ...]


@one_blas_thread
def from_markers(
    times: Array, leading_edge: Array, chord: Array | None, place: WingPlace, hinge: tuple[float, float] | None = None
) -> Angles:
    """Angles of a wing from its markers in body axes, m.

    Args:
        times: [T] s.
        leading_edge: [T, M, 3] markers on the leading edge from root to tip; two, or one with ``hinge``.
        chord: [T, K, 3] markers at the span station of the pitch, from leading to trailing edge, at least two.
        place: which wing it is.
        hinge: y and z (m) of the flapping axis, where known.

    Frames in which a marker is missing are NaN, so that the angles do not jump when markers appear and disappear.
    Without a dihedral the flap angle has an unknown offset, which :func:`wing_motion` removes with ``closed=None``.
    ValueError for too few markers.
    """
    points = leading_edge[..., 1:]
    if hinge is not None:
        points = np.concatenate([np.broadcast_to(hinge, (len(times), 1, 2)), points], axis=1)
    if points.shape[1] < 2:
        raise ValueError("1 marker on the leading edge; name 2 or more, or give the place of the flapping axis (hinge)")
    side = 1.0 if place.right else -1.0
    along = _direction(points)
    rise = np.arctan2(-along[:, 1], side * along[:, 0])  # above the horizontal
    opening = 1.0 if place.upper else -1.0
    flap = opening * (rise - (place.dihedral or 0.0))
    if chord is None:
        return Angles(times, flap)
    if chord.shape[1] < 2:
        raise ValueError("1 marker along the chord; pitch needs 2 or more, from leading to trailing edge")
    across = -opening * (side * np.sin(rise)[:, None] * chord[..., 1] + np.cos(rise)[:, None] * chord[..., 2])
    towards = -_direction(np.stack([chord[..., 0], across], axis=-1))
    pitch = _unwrapped(np.arctan2(towards[:, 0], towards[:, 1]))
    return Angles(times, flap, pitch)


@one_blas_thread
def wing_motion(
    angles: Angles,
    frequency: float | None = None,
    harmonics: int | None = None,
    pitch: PitchKind = "fourier",
    pitch_station: float = 0.7,
    root_pitch: float = np.pi / 2,
    peel_end: float = 0.17,
    start: float | None = None,
    closed: float | None = 0.0,
) -> WingKinematics:
    """Fit the motion of a wing over its beat to ``angles`` measured over several beats.

    Args:
        angles: flap angle and pitch; ValueError without pitch.
        frequency: of the beat, Hz; None: estimated from the flap angle.
        harmonics: number in both series; None: chosen by cross-validation.
        pitch: a Fourier series, or the law of Eq. 17.
        pitch_station: span fraction of the pitch.
        root_pitch: wing pitch at the flapping axis, rad.
        peel_end: t* at which the whole chord has come apart.
        start: a time at which a beat starts, s; None: where the wings are closest.
        closed: measured flap angle of the closed wing, rad; None: the smallest angle of the series.
    """
    if angles.pitch is None:
        raise ValueError("no wing pitch; give a column wing_pitch_deg, or markers along the chord")
    _refuse_still(angles.flap)
    found = Frequency(frequency) if frequency else flap_frequency(angles.times, angles.flap)
    begin = start if start is not None else float(angles.times[0])
    flap = fit_periodic(angles.times, angles.flap, found.hertz, harmonics, begin)
    phase, error = closest(flap)
    remarks = [*angles.remarks, *(f"flap angle: {r}" for r in flap.remarks)]
    if frequency:
        remarks += _unexplained(angles, flap)
    if start is None:
        flap = flap.shifted(phase)
    elif min(phase, 1 - phase) > 0.01 + 3 * error:
        at = f"t* = {phase:.3f} +/- {error:.3f}"
        remarks.append(f"the wings are closest at {at}, not at the start given; are the times those of the beat?")
    if closed is None:
        closed = float(flap.at(np.array(closest(flap)[0])))
        remarks.append("the zero of the flap angle was set where the wings are closest; give the dihedral if known")
    mean = np.eye(1, len(flap.coefficients))[0]
    flap = replace(flap, coefficients=flap.coefficients - closed * mean)
    twist = fit_periodic(angles.times, angles.pitch, found.hertz, harmonics, flap.start)
    remarks += [f"wing pitch: {r}" for r in twist.remarks]
    law = pitch_law(angles.times, angles.pitch, flap) if pitch == "passive" else None
    if law is not None and law.misfit > 2 * twist.noise.deviation:
        misfit = f"the misfit of Eq. 17 to the pitch is {law.misfit / twist.noise.deviation:.1f} times its noise"
        remarks.append(f"{misfit}: the law does not describe this wing")
    twisting = law.pitch if law else FourierPitch(*twist.series)
    motion = WingMotion(FourierFlap(*flap.series), twisting, root_pitch, pitch_station, peel_end)
    fitted = replace(angles, flap=angles.flap - closed)
    return WingKinematics(motion, fitted, flap, twist, law, found, flap.start, error / found.hertz, tuple(remarks))


@one_blas_thread
def flap_frequency(times: Array, flap: Array) -> Frequency:
    """Flap frequency from the flap angle [N] (rad) at ``times`` [N] (s): the peak of the spectrum, then refined.

    The refinement is a least-squares fit of a series and its frequency, whose standard error accounts for coloured
    noise. ValueError if samples or beats are too few, or if the period is not significant by the Wald statistic of the
    series under that noise, with Bonferroni's correction for as many trials as samples.
    """
    _refuse_still(flap)
    seen = np.isfinite(flap)
    t, y = times[seen], flap[seen]
    if len(t) < 9:
        raise ValueError(f"{len(t)} samples of the flap angle; at least 9 are needed to estimate the flap frequency")
    span, step = float(t[-1] - t[0]), float(np.median(np.diff(t)))
    first = _strongest(t, y)
    if span * first < _MIN_BEATS:
        message = (
            f"the recording spans {span * first:.1f} beats; {_MIN_BEATS} are needed to estimate the flap frequency"
        )
        raise ValueError(f"{message}: give it, or record longer")
    if step * first * _MIN_SAMPLES > 1:
        few = f"{1 / (step * first):.2g} samples; at least {_MIN_SAMPLES} are needed"
        message = f"no significant flap frequency: the strongest period, {first:.4g} Hz, has {few}"
        raise ValueError(f"{message}: give the frequency, or check the flap angle")
    orders = max(1, min(4, int(0.4 / (step * first)), (len(t) - 4) // 6))
    middle = float(t.mean())

    def cost(frequency: float) -> float:
        X = basis((t - middle) * frequency, orders)
        return -float(right(X) @ np.linalg.solve(products(X, X), right(X)))

    def right(X: Array) -> Array:
        return np.asarray(np.sum(X * y[:, None], axis=0))

    width = 0.5 / span
    best = scipy.optimize.minimize_scalar(
        cost, bounds=(first - width, first + width), method="bounded", options={"xatol": 1e-9 * first}
    )
    hertz = float(best.x)
    phase = (t - middle) * hertz
    B = basis(phase, orders)
    slope = np.sum(basis(phase, orders, 1) * np.linalg.solve(products(B, B), right(B)), axis=1)
    joint = least_squares(t, np.column_stack([B, slope * (t - middle)]), y)
    moving, scatter = joint.coefficients[1:-1], joint.covariance[1:-1, 1:-1]
    size = float(moving @ np.linalg.solve(scatter, moving)) / len(moving)
    p_value = len(t) * float(scipy.stats.f.sf(size, len(moving), max(len(t) - len(moving) - 2, 1)))
    if p_value > _SIGNIFICANCE:
        raise ValueError(
            f"no significant flap frequency: the strongest period, {hertz:.4g} Hz, is explained by noise of "
            f"{np.degrees(joint.noise.deviation):.2g} deg: give the frequency, or check the flap angle"
        )
    return Frequency(hertz, float(np.sqrt(joint.covariance[-1, -1])))


def _refuse_still(flap: Array) -> None:
    seen = flap[np.isfinite(flap)]
    if len(seen) and np.ptp(seen) < _STILL:
        message = f"the flap angle is {np.degrees(seen[0]):.4g} deg throughout: there is no motion"
        raise ValueError(f"{message}; check the column, or the markers")


def _unexplained(angles: Angles, flap: PeriodicFit) -> list[str]:
    """A remark if the series at the given frequency explains little of the variance of the flap angle."""
    seen = np.isfinite(angles.flap)
    t, y = angles.times[seen], angles.flap[seen]
    share = 1 - float(np.mean((y - flap.at((t - flap.start) * flap.frequency)) ** 2) / np.var(y))
    if share > _MIN_EXPLAINED:
        return []
    try:
        estimated = flap_frequency(angles.times, angles.flap).hertz
        alone = f"the frequency estimated from the flap angle is {estimated:.5g} Hz"
    except ValueError as error:
        alone = f"no frequency can be estimated from the flap angle ({error})"
    given = f"at the flap frequency given, {flap.frequency:.5g} Hz, the motion explains {100 * max(share, 0):.0f} %"
    return [f"{given} of the flap angle's variance; {alone}"]


def _strongest(times: Array, values: Array) -> float:
    """Frequency (Hz) of the largest amplitude of ``values`` [N] at ``times`` [N] (s), in steps of 1 / (8 x duration).

    Gaps are interpolated linearly. Frequencies below one period per record are excluded.
    """
    step = float(np.median(np.diff(times)))
    count = int((times[-1] - times[0]) / step) + 1
    even = np.interp(times[0] + step * np.arange(count), times, values - values.mean())
    size = 8 * count
    whole = size // count  # index of one period per record; lower ones do not count
    amplitude = np.abs(np.fft.rfft(even, size))
    return float((whole + np.argmax(amplitude[whole:])) / (size * step))


def closest(flap: PeriodicFit) -> tuple[float, float]:
    """Phase t* in [0, 1) at which the wings are closest and begin to open, and its standard error in beats.

    It is the minimum of the flap angle. The error results from the noise of the flap rate at that phase and from the
    truncation of the series.
    """
    grid = np.arange(720) / 720
    guess = float(grid[int(np.argmin(flap.at(grid)))])

    def rate(phase: float) -> float:
        return float(flap.at(np.array(phase), 1))

    near = (guess - 1 / 720, guess + 1 / 720)
    phase = float(scipy.optimize.brentq(rate, *near)) if rate(near[0]) < 0 < rate(near[1]) else guess
    bend = float(flap.at(np.array(phase), 2))
    error = float(np.hypot(flap.error_at(np.array(phase), 1), flap.lost[1]))
    return phase % 1.0, error * flap.frequency / max(bend, 1e-12)


@one_blas_thread
def pitch_law(times: Array, pitch: Array, flap: PeriodicFit) -> PitchLaw:
    """Fit Eq. 17, theta_w = pi/2 + c + c_zeta zeta + c_rate zeta' + c_square zeta'^2, to ``pitch`` [N] in rad.

    zeta is the flap angle of the series ``flap`` at ``times`` [N] (s). The errors account for the coloured noise of the
    pitch and, to first order, for that of the flap angle.
    """
    seen = np.isfinite(pitch)
    t, y = times[seen], pitch[seen] - np.pi / 2
    phase = (t - flap.start) * flap.frequency
    zeta, rate = flap.at(phase), flap.at(phase, 1)
    X = np.column_stack([np.ones_like(zeta), zeta, rate, rate**2])
    scale = np.maximum(np.abs(X).max(axis=0), 1e-12)  # rates are a hundred times larger than angles
    linear = least_squares(t, X / scale, y)
    c = linear.coefficients / scale
    B0, B1 = basis(phase, flap.harmonics), basis(phase, flap.harmonics, 1, flap.frequency)
    moving = c[1] * B0 + (c[2] + 2 * c[3] * rate)[:, None] * B1
    moved = np.linalg.solve(products(X / scale, X / scale), products(X / scale, moving))
    covariance = (linear.covariance + moved @ flap.covariance @ moved.T) / np.outer(scale, scale)
    errors = np.sqrt(np.diag(covariance))
    misfit = float(np.sqrt(np.mean(linear.residuals**2)))
    return PitchLaw(PassivePitch(*c.tolist()), errors, covariance / np.outer(errors, errors), misfit)


def beats_of(t_star: Array) -> Array:
    """Phase [N] in beats that increases throughout, from phases ``t_star`` [N] that may restart at 0 in every beat.

    ValueError if a phase is missing (NaN).
    """
    if not np.isfinite(t_star).all():
        raise ValueError("t_star has empty cells; give every row its phase")
    return np.asarray(t_star + np.concatenate([[0.0], np.cumsum(np.ceil(np.maximum(-np.diff(t_star), 0)))]))


def _direction(points: Array) -> Array:
    """Unit vectors [T, 2] of the least-squares lines through ``points`` [T, M, 2], from the first point to the last."""
    d = points - points.mean(axis=1, keepdims=True)
    xx, yy, xy = (np.sum(d[..., i] * d[..., j], axis=1) for i, j in ((0, 0), (1, 1), (0, 1)))
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)
    line = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    sense = np.sum(line * (points[:, -1] - points[:, 0]), axis=1)
    return np.asarray(line * np.where(sense < 0, -1.0, 1.0)[:, None])


def _unwrapped(angles: Array) -> Array:
    """``angles`` [N] (rad) with multiples of 2 pi added so that they do not jump, also across gaps (NaN)."""
    unwrapped = angles.copy()
    seen = np.isfinite(angles)
    unwrapped[seen] = np.unwrap(angles[seen])
    return unwrapped
