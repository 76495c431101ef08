"""By how much the clock of one camera is ahead of that of another: where most rays of the two meet, and meet best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from wingfit.cameras.camera import Camera
from wingfit.cameras.track.cloud import possible_points
from wingfit.cameras.track.tracklets import Tracklets, at_time
from wingfit.records.array_types import Array, Float

_SAMPLED = 40


@dataclass(frozen=True)
class Offset:
    """What is added to times (s) of the first camera to get those of another, and its standard error (s)."""

    seconds: float
    standard_error: float


def offset_between(
    cameras: tuple[Camera, Camera],
    tracklets: tuple[Tracklets, Tracklets],
    times: Float[Array, " T"],
    frame_s: float,
    within_s: float,
    tolerance_px: float,
) -> Offset:
    """Estimate the offset of the second camera's clock from images of both of a moving wing.

    ``times`` (s) are instants of the first camera, of which some are used. Offsets up to ``within_s`` are tried, half a
    frame (``frame_s``) apart; the best is refined. The standard error is that of the least squares of the misfits.
    """
    used = times[np.unique(np.linspace(0, len(times) - 1, _SAMPLED).astype(int))]
    first = [at_time(tracklets[0], time, 1.5 * frame_s) for time in used]

    def misfits(offset: float) -> Array:
        found = []
        for time, one in zip(used, first, strict=True):
            two = at_time(tracklets[1], time + offset, 1.5 * frame_s)
            cloud = possible_points(cameras, (one, two), tolerance_px, (0.0, np.inf))
            best = np.full(len(one), 16.0)
            np.minimum.at(best, cloud.detections[0], cloud.points.misfit)
            found.append(best)
        return np.concatenate(found)

    steps = max(int(np.ceil(2 * within_s / frame_s)), 1)
    tried = np.linspace(-within_s, within_s, 2 * steps + 1)
    costs = np.array([misfits(offset).mean() for offset in tried])
    best = float(tried[int(np.argmin(costs))])
    found = minimize_scalar(
        lambda offset: float(misfits(offset).mean()), bounds=(best - frame_s, best + frame_s), method="bounded",
        options={"xatol": 1e-3 * frame_s},
    )  # fmt: skip
    at, step = float(found.x), 0.1 * frame_s
    here, up, down = (misfits(at + move) for move in (0.0, step, -step))
    curvature = max((up.sum() + down.sum() - 2 * here.sum()) / step**2, 1e-12)
    scatter = max(here.sum() / max(len(here) - 1, 1), 1.0)
    return Offset(at, float(np.sqrt(2 * scatter / curvature)))


def common_times(
    tracklets: Sequence[Tracklets], offsets: Sequence[float], times: Float[Array, " T"]
) -> Float[Array, " T"]:
    """Return those ``times`` (s, the first camera's clock) within the films of all cameras."""
    keep = np.ones(len(times), dtype=bool)
    for one, offset in zip(tracklets, offsets, strict=True):
        if len(one.owner):
            keep &= (times + offset >= one.period[0]) & (times + offset <= one.period[1])
    return np.asarray(times[keep])
