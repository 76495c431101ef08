"""Forces on a freely flying body from its tracked markers, F = m (a - g), with their standard deviations.

The tracking frame is inertial with z up; body axes are x forward, y right, z down. The vehicle is treated as one rigid
body (single rigid body kinematics, as in Armanini et al. 2016, Fig. 10a), so the forces include those of the tail and
of the inertia of the wings.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy

from wingfit.records import Condition, LowPass, Recording
from wingfit.records.array_types import Array, Index, Mask
from wingfit.records.blas_threads import one_blas_thread
from wingfit.records.dataset import STANDARD_GRAVITY
from wingfit.records.limits import UNEVEN_STEPS
from wingfit.tracking.rigid_body import Poses, cross_matrices, poses, quaternions, scale_remarks
from wingfit.tracking.zero_phase import Kernels, kernels

_CHUNK = 512
_LAGS = 50
_MAX_SPEED = 100.0  # m/s, as in a dataset


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body: positions of its ``markers`` [M, 3] and its ``centre`` of mass [3] in body axes (m), ``mass`` (kg).

    ``inertia`` [3, 3] about the centre of mass in body axes, kg m^2; None: no moments are computed.
    """

    markers: Array
    centre: Array
    mass: float
    inertia: Array | None = None


@dataclass(frozen=True, eq=False)
class MarkerNoise:
    """Noise of one coordinate of one marker, m, estimated from the residuals of the rigid-body fit.

    ``deviation``: standard deviation, m; ``correlation`` [L]: autocorrelation at lags of 0, 1, ... frames; ``common``,
    at least 1: RMS scatter of the centre of mass above the cut-off, divided by that expected of independent markers.
    ``common`` scales the standard deviations of force and moment.
    """

    deviation: float
    correlation: Array
    common: float


@dataclass(frozen=True, eq=False)
class FreeFlight:
    """Motion of the body and the loads on it at T frames; NaN near ends and gaps.

    ``force`` and ``moment`` [T, 3] in body axes (N, N m; moment None without inertia), with the standard deviations
    at every instant that result from marker noise; ``position`` (m), ``velocity`` (m/s) [T, 3] of the centre of mass in
    tracking axes; ``rotation`` [T, 3, 3] body to tracking axes, smoothed; ``rate`` [T, 3] angular velocity in body
    axes, rad/s; ``poses``: unsmoothed.
    """

    times: Array
    force: Array
    force_deviation: Array
    moment: Array | None
    moment_deviation: Array | None
    position: Array
    velocity: Array
    rotation: Array
    rate: Array
    noise: MarkerNoise
    low_pass: LowPass
    mass: float
    poses: Poses
    remarks: tuple[str, ...]

    @property
    def pitch(self) -> Array:
        """Body pitch theta_b [T], rad: angle of the nose above the horizontal."""
        return np.asarray(np.arcsin(np.clip(self.rotation[:, 2, 0], -1, 1)))


@one_blas_thread
def free_flight(
    times: Array, tracks: Array, body: Body, low_pass: LowPass, gravity: float = STANDARD_GRAVITY
) -> FreeFlight:
    """Forces on ``body`` from ``tracks`` [T, M, 3] (m, tracking axes, NaN where not seen) at even ``times`` [T] (s).

    The force is m (a - g), with ``gravity`` in m/s^2. Gaps up to a quarter period of the cut-off are
    interpolated by cubic splines. On either side of longer gaps, and at the ends, the results are NaN for half the
    length of the filter. ValueError if times or units are wrong, or if no frame remains.
    """
    step = _even_step(times)
    windows = kernels(low_pass, 1 / step)
    remarks = scale_remarks(tracks, body.markers)
    found = poses(tracks, body.markers)
    remarks += _about(found)
    centre = found.position + found.rotation @ body.centre
    q = quaternions(found.rotation)
    longest = int(0.25 / (low_pass.cutoff * step))
    state = np.column_stack([centre, q])
    bridges = _bridges(np.isfinite(state[:, 0]), longest)
    filled = state.copy()
    for bridge in bridges:
        filled[bridge.frame] = bridge.weights @ state[bridge.near]
    if bridges:
        remarks.append(f"{len(bridges)} frames without a pose were interpolated (gaps of at most {longest} frames)")
    smooth = [windows.apply(filled, d) for d in range(3)]
    if not np.isfinite(smooth[2]).any():
        message = f"{len(times)} frames hold no {2 * windows.reach + 1} in a row with a pose, which the filter needs"
        raise ValueError(f"{message}: raise the cut-off, record longer, or keep the markers in view")
    speed = float(np.linalg.norm(np.nanmean(smooth[1][:, :3], axis=0)))
    if speed > _MAX_SPEED:
        raise ValueError(
            f"the body flies at {speed:.4g} m/s; it must be at most {_MAX_SPEED:g} m/s: give the markers of both "
            "files in metres and time_s in seconds"
        )
    R, rate, turning = _attitude(smooth)
    weight = np.array([0.0, 0.0, gravity])
    force = body.mass * np.einsum("tji,tj->ti", R, smooth[2][:, :3] + weight)
    noise = _noise(found, centre, body, step, low_pass)
    if noise.common > 1.2:
        remarks.append(
            f"the centre of mass scatters {noise.common:.1f} times more above the cut-off than the markers' own noise "
            "explains (cameras, or motion beyond the cut-off); the standard deviations are raised accordingly"
        )
    force_sd = _deviation(found, R, body, windows, bridges, noise, force, None)
    moment = moment_sd = None
    if body.inertia is not None:
        spin = rate @ body.inertia.T
        moment = turning @ body.inertia.T + np.cross(rate, spin)
        moment_sd = _deviation(found, R, body, windows, bridges, noise, force, body.inertia)
    return FreeFlight(
        times, force, force_sd, moment, moment_sd, smooth[0][:, :3], smooth[1][:, :3], R, rate, noise, low_pass,
        body.mass, found, tuple(remarks),
    )  # fmt: skip


@one_blas_thread
def recording(
    flight: FreeFlight, name: str, flap_frequency: float, beat_start: float, pressure: float, temperature: float
) -> Recording:
    """Forces along body x and z (N) of ``flight`` as a recording called ``name``, in level flight through still air.

    ``flap_frequency`` in Hz; ``pressure`` (Pa), ``temperature`` (K) of the air. ``beat_start`` is a time (s, clock of
    the tracks) at which a beat starts; the recording's times count from the last start of a beat before the first
    force. The airspeed is the magnitude of the mean velocity, the angle of attack the mean body pitch, the standard
    deviation the RMS over the instants.
    """
    known = np.isfinite(flight.force).all(axis=1)
    first, last = np.flatnonzero(known)[[0, -1]]
    rows = slice(first, last + 1)
    beats = np.floor((flight.times[first] - beat_start) * flap_frequency)
    speed = float(np.linalg.norm(np.nanmean(flight.velocity, axis=0)))
    condition = Condition(
        flap_frequency, 0.0, pressure, temperature, airspeed=speed, angle_of_attack=float(np.nanmean(flight.pitch))
    )
    return Recording(
        name,
        "free_flight",
        condition,
        flight.times[rows] - beat_start - beats / flap_frequency,
        (),
        flight.force[rows][:, [0, 2]],
        np.sqrt(np.nanmean(flight.force_deviation[:, [0, 2]] ** 2, axis=0)),
        forces=("x", "z"),
        low_pass=flight.low_pass,
        mass=flight.mass,
    )


def _even_step(times: Array) -> float:
    if len(times) < 3:
        raise ValueError(
            f"{len(times)} frames; forces need at least 3, and as many more as the filter spans: record longer"
        )
    step = float(np.median(np.diff(times)))
    worst = float(np.max(np.abs(np.diff(times) - step)))
    if worst > UNEVEN_STEPS * step:
        raise ValueError(
            f"steps differ by up to {worst:.3g} s from {step:.3g} s; frames must be even within "
            f"{100 * UNEVEN_STEPS:g} %: give every frame a row, with empty cells where a marker was not seen"
        )
    return float((times[-1] - times[0]) / (len(times) - 1))


def _about(found: Poses) -> list[str]:
    """Remarks for the user: numbers, if not zero, of frames without a pose and of samples excluded as outliers."""
    frames, missing, rejected = len(found.position), int(np.isnan(found.position[:, 0]).sum()), found.rejected
    remarks = {
        f"{missing} of {frames} frames have no pose: fewer than 3 markers, or markers on one line": missing,
        f"{rejected} samples were excluded: they lie far from the rigid body (swapped or loose markers?)": rejected,
    }
    return [remark for remark, count in remarks.items() if count]


@dataclass(frozen=True, eq=False)
class _Bridge:
    """Index of a ``frame`` without a pose, interpolated from the frames ``near`` [K] with ``weights`` [K]."""

    frame: int
    near: Index
    weights: Array


def _bridges(known: Mask, longest: int) -> list[_Bridge]:
    """Cubic-spline weights for each frame in gaps of at most ``longest`` frames; ``known`` [T]: the frame has a pose.

    A gap with fewer than four known frames near it is not interpolated.
    """
    rows, found = np.flatnonzero(known), []
    for before, after in pairwise(rows.tolist()):
        if 1 < after - before <= longest + 1:
            near = rows[np.abs(rows - before) <= 4 * (longest + 1)]
            if len(near) < 4:
                continue
            spline = scipy.interpolate.CubicSpline(near, np.eye(len(near)))
            found += [_Bridge(int(frame), near, spline(frame)) for frame in range(before + 1, after)]
    return found


def _spread_over(taps: Array, rows: Index, bridges: list[_Bridge]) -> Array:
    """Filter weights [R, 2 n + 1] of the result at each of the R frames ``rows``, on measured frames only.

    They are ``taps`` [2 n + 1], except that the weight of each interpolated frame in ``bridges`` is distributed over
    the frames from which it is interpolated.
    """
    n, spread = len(taps) // 2, np.tile(taps, (len(rows), 1))
    for bridge in bridges:
        place = bridge.frame - rows + n
        for i in np.flatnonzero((place >= 0) & (place <= 2 * n)):
            share, target = spread[i, place[i]], bridge.near - rows[i] + n
            inside = (target >= 0) & (target <= 2 * n)
            spread[i, target[inside]] += share * bridge.weights[inside]
            spread[i, place[i]] = 0.0
    return spread


def _attitude(smooth: list[Array]) -> tuple[Array, Array, Array]:
    """Rotation [T, 3, 3], angular velocity (rad/s) and acceleration (rad/s^2) [T, 3] in body axes from quaternions.

    ``smooth``: smoothed pose [T, 7] (position, quaternion w, x, y, z) and its first two derivatives by time (s).
    """
    size = np.linalg.norm(smooth[0][:, 3:], axis=1, keepdims=True)
    q, dq, ddq = (s[:, 3:] / size for s in smooth)
    w, v = q[:, :1], q[:, 1:]
    R, known = np.full((len(q), 3, 3), np.nan), np.isfinite(w[:, 0])
    R[known] = scipy.spatial.transform.Rotation.from_quat(q[known], scalar_first=True).as_matrix()
    # omega = 2 conj(q) dq/dt; the derivative of conj(q) adds only to the scalar part.
    rate, turning = (2 * (w * d[:, 1:] - d[:, :1] * v - np.cross(v, d[:, 1:])) for d in (dq, ddq))
    return R, rate, turning


def _noise(found: Poses, centre: Array, body: Body, step: float, low_pass: LowPass) -> MarkerNoise:
    """Noise of a marker from the residuals of the rigid-body fit; common factor from the centre of mass.

    ``centre`` [T, 3]: measured centre of mass, m, whose scatter above the cut-off is noise; ``step``: time between
    frames, s.
    """
    used = np.isfinite(found.position[:, 0])
    free = 3 * found.seen[used].sum() - 6 * used.sum()
    deviation = float(np.sqrt(np.nansum(found.residuals[used] ** 2) / free))
    correlation = _correlation(found.residuals, min(_LAGS, len(centre) // 4))
    # Between the cut-off and the Nyquist frequency the body hardly moves, so the signal there is noise.
    high = kernels(LowPass(min(1.6 * low_pass.cutoff, 0.45 / step), 8), 1 / step)
    rest = centre - high.apply(centre, 0)
    taps = -high.taps[0]
    taps[high.reach] += 1
    # Variance of a coordinate of the centre of mass over that of a marker, mean over axes and frames.
    gain = float(np.mean(np.sum(_of_centre(found, body)[used, :3] ** 2, axis=2)))
    expected = deviation**2 * float(taps @ _toeplitz(correlation, len(taps)) @ taps) * gain
    if not np.isfinite(rest).any():
        return MarkerNoise(deviation, correlation, 1.0)
    common = float(np.sqrt(np.nanmean(rest**2) / max(expected, 1e-30)))
    return MarkerNoise(deviation, correlation, max(1.0, common))


def _of_centre(found: Poses, body: Body) -> Array:
    """Derivative [T, 6, 3 M] of centre of mass (m) and rotation (rad) by markers' displacements (m), in body axes."""
    G = found.sensitivity
    moved = G.copy()
    moved[:, :3] -= cross_matrices(body.centre) @ G[:, 3:]
    return moved


def _correlation(residuals: Array, lags: int) -> Array:
    """Autocorrelation [L] in time of ``residuals`` [T, M, 3] at lags of 0, 1, ... frames, 1 at lag 0.

    It is estimated at ``lags`` lags at most, up to the first value that is not significant, then made valid by
    :func:`_admissible`, which appends lags.
    """
    r = residuals.reshape(len(residuals), -1)
    r = r - np.nanmean(r, axis=0)
    variance = float(np.nanmean(r**2))
    values = [1.0]
    for lag in range(1, lags):
        products = r[lag:] * r[:-lag]
        value = float(np.nanmean(products)) / max(variance, 1e-30)
        if abs(value) < 2.0 / np.sqrt(max(int(np.isfinite(products).sum()), 1)):
            break
        values.append(value)
    return _admissible(np.array(values))


def _admissible(values: Array) -> Array:
    """Valid autocorrelation [2 L + 2] close to ``values`` [L], padded with zeros: negative spectral values set to zero.

    It is divided by its value at lag 0.
    """
    size = 4 * len(values) + 4
    wrapped = np.zeros(size)
    wrapped[: len(values)] = values
    wrapped[-len(values) + 1 :] = values[:0:-1] if len(values) > 1 else wrapped[-len(values) + 1 :]
    spectrum = np.maximum(np.fft.rfft(wrapped).real, 0)
    cleaned = np.fft.irfft(spectrum, size)
    return np.asarray(cleaned[: size // 2] / cleaned[0])


def _toeplitz(correlation: Array, size: int) -> Array:
    """Correlation matrix [size, size] of successive samples from the autocorrelation [L], taken as zero from lag L."""
    return np.asarray(scipy.linalg.toeplitz(np.pad(correlation, (0, size))[:size]))


def _deviation(
    found: Poses,
    R: Array,
    body: Body,
    windows: Kernels,
    bridges: list[_Bridge],
    noise: MarkerNoise,
    force: Array,
    inertia: Array | None,
) -> Array:
    """Standard deviation [T, 3] of force (N), or with ``inertia`` of moment (N m), from the noise of the markers.

    The error is, to first order in the noise, a weighted sum over all markers and the frames of the filter window; its
    variance follows from the weights and from the autocorrelation of the noise.
    """
    n, result = windows.reach, np.full(force.shape, np.nan)
    fitted = np.isfinite(found.position[:, 0])
    G = np.where(fitted[:, None, None], _of_centre(found, body), 0.0)
    turns = np.where(fitted[:, None, None], found.rotation, 0.0)
    correlation = _toeplitz(noise.correlation, 2 * n + 1)
    known = np.flatnonzero(np.isfinite(force[:, 0]))
    for rows in (known[start : start + _CHUNK] for start in range(0, len(known), _CHUNK)):
        frames = rows[:, None] + np.arange(-n, n + 1)
        # From body axes of the window's frames to those of this frame.
        back = np.einsum("tji,tkjl->tkil", R[rows], turns[frames])
        rotated = back @ G[frames][:, :, 3:]
        value, _, bend = (_spread_over(taps, rows, bridges)[..., None, None] for taps in windows.taps)
        if inertia is None:
            weights = body.mass * bend * (back @ G[frames][:, :, :3])
            weights = weights + value * (cross_matrices(force[rows])[:, None] @ rotated)
        else:
            weights = bend * (inertia @ rotated)
        spread = np.einsum("tkic,kl->tlic", weights, correlation, optimize=True)
        result[rows] = np.sqrt(np.maximum(np.sum(spread * weights, axis=(1, 3)), 0))
    return result * noise.deviation * noise.common
