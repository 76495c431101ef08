"""Simulated filming: turns the motion of a wing into a recording of its markers.

Strobe or fast cameras, a tracker, noise, gaps, and the faults of :data:`FAULTS`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from benchmarks.concealed.plant.law import Concealed, Law, Parameters, check_known, strength
from benchmarks.concealed.plant.measurement.cameras import Cameras, Tracks, direction_values, draw_cameras, places, seen
from benchmarks.concealed.plant.measurement.noise import Noise, bursts, draw_noise, track_noise
from wingfit.records import Condition, Recording, Wing

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Mode = Literal["strobe", "fast"]

_KEPT_REFERENCES = 4  # reference markers that are never lost: the start of a beat is defined by them
_DECIMALS = 5  # of positions in m
_AROUND = 8  # neighbours from which the rotation of the skin at a marker is computed
_SWAP_FRAMES = 8.0  # mean length of a swap
_MOST_SMOOTH = 0.9  # largest share of the past that a smoothed position keeps
_WANDER = 0.15  # fraction of a clock error that grows with time; the rest is constant


@dataclass(frozen=True)
class Filming:
    """How a wing is filmed.

    Attributes:
        noise: settings of the noise of the tracks.
        mode: "strobe": each frame is of another beat, at a slightly earlier phase than the previous frame; "fast": many
            frames in each beat.
        beats: number of beats shown: apparent beats of a strobe, real ones of a fast camera.
        per_beat: n; a strobe takes n + 1 frames in an apparent beat, a fast camera n plus a random fraction in a beat.
        lost: number of markers that are never visible.
        gap_rate: probability per frame that a marker is lost for a while.
        gap_frames: mean length of such a gap, frames.
    """

    noise: Noise
    mode: Mode = "strobe"
    beats: int = 3
    per_beat: int = 30
    lost: int = 9
    gap_rate: float = 0.006
    gap_frames: float = 5.0


class Filmed(NamedTuple):
    """A recording of the markers.

    ``clean`` [T frames, C channels]: the recorded positions without noise but with the same gaps, m; ``noise``: RMS
    noise, m.
    """

    recording: Recording
    clean: Array
    noise: float


def draw_filming(rng: np.random.Generator, mode: Mode | None = None) -> Filming:
    """Settings of filming drawn from ``rng``; without a given ``mode``, a strobe in three of four cases."""
    drawn: Mode = "strobe" if rng.uniform() < 0.75 else "fast"
    beats, per_beat, lost = (int(n) for n in rng.integers([2, 24, 5], [5, 37, 13]))
    rate, frames = (float(g) for g in rng.uniform([0.002, 3.0], [0.012, 8.0]))
    return Filming(draw_noise(rng), mode or drawn, beats, per_beat, lost, rate, frames)


def film(
    tracks: Array,
    wing: Wing,
    condition: Condition,
    filming: Filming,
    rng: np.random.Generator,
    hidden: Concealed | None = None,
    *,
    name: str = "film",
    cameras: Cameras | None = None,
) -> Filmed:
    """Simulate a recording of a periodic motion by two cameras.

    Args:
        tracks: all markers of ``wing`` over one beat, [n, M, 3] in m at n equal steps from drive phase 0.
        wing: the wing that is filmed.
        condition: condition of the recording, of which frequency and airspeed are used.
        filming: settings of the noise, the frames and the gaps.
        rng: source of all random numbers; the draws depend neither on ``hidden`` nor on the RMS of the noise.
        hidden: parameters of the faults, by name as in :data:`FAULTS`.
        name: name of the recording.
        cameras: the pair of cameras, drawn at random if not given; pass one pair to share it between recordings.
    """
    hidden = hidden or {}
    check_known(hidden, FAULTS)
    frequency, (eyes, order, dice) = condition.flap_frequency, rng.spawn(3)
    cameras = cameras or draw_cameras(wing, eyes)
    times = _times(filming, frequency, order)
    beats = _beats(times, frequency, hidden) + order.uniform()
    kept = _kept(wing, filming.lost, order, hidden)
    swapped = _swaps(len(times), strength(hidden, "marker_swap"), order)
    true = _slipped(seen(_between(tracks), beats, frequency, cameras, wing, hidden), wing, hidden)
    noisy = true + track_noise(filming.noise, len(times), len(wing.markers), dice)
    hole = bursts((len(times), len(wing.markers)), filming.gap_rate, filming.gap_frames, dice)
    both = []
    for one in (noisy, true):
        followed = tracked(_crept(_exchanged(one, wing, swapped, hidden), times, hidden), hole, hidden)
        followed = smoothed(followed, hole, strength(hidden, "exponential_smoothing"))
        followed[hole] = np.nan
        both.append(np.ascontiguousarray(followed[:, kept].reshape(len(times), -1)))
    values, clean = both
    rig: Literal["wind_tunnel", "vacuum_chamber"] = "wind_tunnel" if condition.airspeed > 0 else "vacuum_chamber"
    markers = tuple(wing.markers[k].name for k in kept)
    recording = Recording(name, rig, condition, times, markers, np.round(values, _DECIMALS))
    return Filmed(recording, clean, float(np.sqrt(np.nanmean((values - clean) ** 2))))


def _between(tracks: Array) -> Tracks:
    """Function from phases [T, M] (beats) to positions [T, M, 3] (m) of each marker at its own phases.

    It interpolates ``tracks`` [n, M, 3] by periodic cubic splines.
    """
    steps, columns = len(tracks), np.arange(tracks.shape[1])
    motion = CubicSpline(np.arange(steps + 1) / steps, np.concatenate([tracks, tracks[:1]]), 0, "periodic")

    def at(phase: Array) -> Array:
        step = phase % 1.0 * steps
        k = np.minimum(step.astype(int), steps - 1)
        u = ((step - k) / steps)[..., None]
        a, b, c, d = (motion.c[power][k, columns] for power in range(4))
        return np.asarray(((a * u + b) * u + c) * u + d)

    return at


def _times(filming: Filming, frequency: float, rng: np.random.Generator) -> Array:
    """Times [T] of the frames, s. A fast camera's frames are at other phases in each beat than in the previous one."""
    odd = rng.uniform(0.2, 0.8)
    if filming.mode == "strobe":
        rate, frames = frequency * (filming.per_beat + 1) / filming.per_beat, (filming.per_beat + 1) * filming.beats
    else:
        rate, frames = frequency * (filming.per_beat + odd), math.ceil((filming.per_beat + odd) * filming.beats)
    return np.round(np.arange(frames) / rate, 7)


def _beats(times: Array, frequency: float, hidden: Concealed) -> Array:
    """True phase [T] (beats) at the recorded ``times`` [T] (s); with "strobe_rate", true time passes faster."""
    late = times - times.mean()
    fast = strength(hidden, "strobe_rate") * (1.0 + _WANDER * late / (np.ptp(times) + 1e-12))
    return np.asarray(frequency * (times + fast * late))


def _kept(wing: Wing, lost: int, rng: np.random.Generator, hidden: Concealed) -> list[int]:
    """Indices of visible markers: all but ``lost`` random ones, never markers of a hidden fault or four references."""
    order = [int(k) for k in rng.permutation(len(wing.markers))]
    references = [k for k in order if wing.markers[k].name in wing.reference_markers][:_KEPT_REFERENCES]
    concerned = [k for name in ("marker_slip", "marker_swap") if name in hidden for k in _pair(wing, hidden[name])]
    may_go = [k for k in order if k not in references and k not in concerned]
    return sorted(set(order) - set(may_go[:lost]))


def _pair(wing: Wing, p: Parameters) -> tuple[int, int]:
    """Indices of the marker nearest to "span", "chord" (fractions) in ``p``, and of its nearest neighbour."""
    rest = np.array([marker.position for marker in wing.markers])
    part = places(wing)
    one = int(np.hypot(part[:, 0] - p["span"], (part[:, 1] - p["chord"]) * 0.4).argmin())
    return one, int(np.argsort(np.linalg.norm(rest - rest[one], axis=1))[1])


def _slipped(tracks: Array, wing: Wing, hidden: Concealed) -> Array:
    """Tracks [T, M, 3] with one slipped marker: displaced along the skin by the hidden fault's "strength" (m).

    The skin's rotation in each frame is fitted to the neighbouring markers (Kabsch 1976).
    """
    if not strength(hidden, "marker_slip"):
        return tracks
    p = hidden["marker_slip"]
    rest = np.array([marker.position for marker in wing.markers])
    one, _ = _pair(wing, p)
    around = np.argsort(np.linalg.norm(rest - rest[one], axis=1))[1 : 1 + _AROUND]
    moved = p["strength"] * np.array([math.cos(p["azimuth"]), math.sin(p["azimuth"]), 0.0])
    out, plate = tracks.copy(), rest[around] - rest[around].mean(axis=0)
    for frame, now in zip(out, tracks[:, around], strict=True):
        frame[one] += Rotation.align_vectors(now - now.mean(axis=0), plate)[0].apply(moved)
    return out


def _swaps(frames: int, part: float, rng: np.random.Generator) -> Bools:
    """Mask [T] of the frames in which two markers swap names: random bursts, the fraction ``part`` of all frames."""
    wanted = round(min(part, 1.0) * frames)
    changed = np.zeros(frames, bool)
    dice = rng.spawn(1)[0]
    while changed.sum() < wanted:
        start, length = int(dice.integers(frames)), int(dice.geometric(1.0 / _SWAP_FRAMES))
        changed[start : start + min(length, wanted - int(changed.sum()))] = True
    return changed


def _exchanged(tracks: Array, wing: Wing, frames: Bools, hidden: Concealed) -> Array:
    """Tracks [T, M, 3] with two neighbouring markers exchanged in the frames where the mask ``frames`` [T] is True."""
    if not frames.any():
        return tracks
    one, other = _pair(wing, hidden["marker_swap"])
    out = tracks.copy()
    out[frames, one], out[frames, other] = tracks[frames, other], tracks[frames, one]
    return out


def _crept(tracks: Array, times: Array, hidden: Concealed) -> Array:
    """Tracks [T, M, 3] (m) plus a drift that levels off, as lamps warm the cameras' mount (Fraser 1997)."""
    if not strength(hidden, "thermal_creep"):
        return tracks
    p = hidden["thermal_creep"]
    along = times / times[-1]
    moved = p["strength"] * -np.expm1(-along / p["time"])[:, None, None]
    return np.asarray(tracks + moved * np.array([math.cos(p["azimuth"]), math.sin(p["azimuth"]), 0.5]))


def tracked(tracks: Array, hole: Bools, hidden: Concealed) -> Array:
    """Tracks [T, M, 3] (m) as reported by a tracker's Kalman filter, which lags behind fast motion.

    The filter's states are position, velocity and acceleration, with white noise as jerk and the covariance of
    Bar-Shalom, Li and Kirubarajan (2001, sect. 6.2.3). The standard deviation of the jerk is 1 / ``strength`` of the
    hidden "tracker_lag", in units of the measurement's standard deviation and of frames. The filter extrapolates where
    the mask ``hole`` [T, M] is True.
    """
    if not strength(hidden, "tracker_lag"):
        return tracks.copy()  # with unlimited jerk the filter follows every frame
    F = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    Q = (
        np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
        / strength(hidden, "tracker_lag") ** 2
    )
    x, P = _started(tracks), np.tile(100.0 * np.eye(3), (tracks.shape[1], 1, 1))
    out = np.empty_like(tracks)
    for t, frame in enumerate(tracks):
        x, P = np.einsum("ij,jmk->imk", F, x), F @ P @ F.T + Q
        gain = np.where(hole[t][:, None], 0.0, P[:, :, 0] / (P[:, :1, 0] + 1.0))
        x = x + gain.T[:, :, None] * (frame - x[0])
        P = P - gain[:, :, None] * P[:, :1]
        out[t] = x[0]
    return out


def smoothed(tracks: Array, hole: Bools, share: float) -> Array:
    """Tracks [T, M, 3] (m) after the low-pass of a tracker: an RC filter of the straight lines between frames.

    Its time constant is share / (1 - share) frames, the lag of exponential smoothing of this weight (Brown 1963); the
    step is exact for a signal that is linear between frames (Franklin, Powell and Workman 1998, sect. 6.3). It starts
    again after a gap, where the mask ``hole`` [T, M] is True.
    """
    if not share:
        return tracks
    part = min(share, _MOST_SMOOTH)
    frames = part / (1.0 - part)
    keep = math.exp(-1.0 / frames)
    new, last = 1.0 - (1.0 - keep) * frames, (1.0 - keep) * frames - keep
    out = np.empty_like(tracks)
    out[0] = tracks[0] - frames * (tracks[1] - tracks[0])
    for t in range(1, len(tracks)):
        followed = keep * out[t - 1] + new * tracks[t] + last * tracks[t - 1]
        out[t] = np.where(hole[t - 1][:, None], tracks[t], followed)
    return out


def _started(tracks: Array) -> Array:
    """Initial state [3, M, 3] of the filter: position, velocity, acceleration one frame before the first (per frame).

    They follow from a parabola fitted to the first five frames.
    """
    first = np.polyfit(np.arange(1, 6), tracks[:5].reshape(5, -1), 2)[::-1] * np.array([[1.0], [1.0], [2.0]])
    return np.asarray(first.reshape(3, *tracks.shape[1:]))


_ANGLES = {"azimuth": (0.0, 2.0 * math.pi), "height": (-0.8, 0.8)}
_PLACE = {"span": (0.3, 0.95), "chord": (0.1, 0.9)}
_WAY = {"azimuth": (0.0, 2.0 * math.pi)}
_listed = partial(Law, side="measurement")
_unlisted = partial(Law, side="measurement", listed=False)
FAULTS = {
    law.name: law
    for law in (
        _listed(
            "camera_rotation",
            typical=0.01,
            source="wrong outer orientation, Cardan angles (Luhmann et al. 2014)",
            shape=_ANGLES,
            values=lambda p: direction_values("camera_rotation", p),
        ),
        _listed(
            "camera_shift",
            typical=3e-3,
            source="wrong outer orientation (Luhmann et al. 2014)",
            shape=_ANGLES,
            values=lambda p: direction_values("camera_shift", p),
        ),
        _listed("lens_distortion", typical=0.1, source="division model (Fitzgibbon 2001)", both_signs=True),
        _listed("marker_slip", typical=6e-3, source="sliding on a plate (Kabsch 1976)", shape=_PLACE | _WAY),
        _listed(
            "marker_swap",
            typical=0.5,
            source="identity switches in bursts (Bernardin and Stiefelhagen 2008)",
            shape=_PLACE,
            values=lambda p: {"marker_swap.part": p["strength"]},
        ),
        _listed("tracker_lag", typical=2.0, source="Kalman filter (Bar-Shalom, Li and Kirubarajan 2001, sect. 6.2)"),
        _listed(
            "exponential_smoothing",
            typical=0.2,
            source="RC filter of a signal linear between frames (Franklin, Powell and Workman 1998), of the same lag",
        ),
        _listed("rolling_shutter", typical=4e-3, source="row by row (Liang, Chang and Chen 2008)", both_signs=True),
        _listed(
            "camera_desync",
            typical=2e-3,
            source="images of two instants (Bradley et al. 2009)",
            both_signs=True,
            values=lambda p: {"camera_desync.delay": p["strength"]},
        ),
        _listed(
            "scale_error",
            typical=0.01,
            source="wrong distance between the cameras (Luhmann et al. 2014)",
            both_signs=True,
            values=lambda p: {"scale_error.part": p["strength"]},
        ),
        _listed(
            "strobe_rate",
            typical=1e-4,
            source="a clock with offset and drift (Allan 1966)",
            both_signs=True,
            values=lambda p: {"strobe_rate.part": p["strength"]},
        ),
        _unlisted("pane_edge", typical=3e-3, source="Born and Wolf (1999)", shape={"span": (0.4, 0.8)} | _WAY),
        _unlisted(
            "glare",
            typical=6e-3,
            source="a highlight moves over a curved surface (Blake and Brelstaff 1988)",
            shape={"phase": (0.0, 1.0)} | _PLACE | _WAY,
        ),
        _unlisted(
            "thermal_creep", typical=4e-3, source="warming cameras (Fraser 1997)", shape={"time": (0.3, 1.0)} | _WAY
        ),
    )
}


def with_noise(filming: Filming, level: float) -> Filming:
    """Copy of the settings ``filming`` with the RMS noise ``level``, m."""
    return replace(filming, noise=replace(filming.noise, level=level))
