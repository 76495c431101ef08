"""Flashes of a strobe in the film of a camera with a rolling shutter.

A row is exposed until it is read, row after row; in the dark the exposure lasts nearly a whole frame. A flash is
therefore seen by the rows that are read after it in one frame, the lower ones, and by the others in the next frame. The
two are merged by adding them, which also restores the rows that saw a part of the flash in each. The row at which the
frames divide says when in the frame the flash was.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.cameras.video.source import Frames
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import fail

_SAMPLED, _FIRST_FRAMES = 25, 150
_NOISES, _GREY_LEVELS, _LEAST_PIXELS = 8.0, 6.0, 12
_MOST_LIT = 0.7  # share of frames
_GOLDEN = 0.618034


@dataclass(frozen=True)
class FlashMark:
    """Where in a film one flash is.

    Attributes:
        frame: number of the first frame with light of the flash.
        split: row (pixels) at which the two frames divide: rows from there on saw the flash in ``frame``, those above
            in the next one. It lies in the range ``between``, as wide as the rows without markers.
        between: see above.
    """

    frame: int
    split: float
    between: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Flash:
    """One flash as one camera saw it.

    Attributes:
        mark: where in the film it is.
        image: [H, W], the two frames merged, without the light that is always there.
        noise: of a pixel of ``image`` (grey levels).
    """

    mark: FlashMark
    image: Float[Array, "H W"]
    noise: float


@dataclass(frozen=True, eq=False)
class Background:
    """What the camera sees without flash: ``image`` [H, W], and the ``noise`` of a pixel of one frame (grey levels)."""

    image: Float[Array, "H W"]
    noise: float

    def lit(self, frame: Array) -> bool:
        """Return whether ``frame`` saw a flash."""
        threshold = max(_NOISES * self.noise, _GREY_LEVELS)
        bright = frame.astype(np.float32) - self.image > threshold
        return int(np.count_nonzero(bright)) >= _LEAST_PIXELS


def background(frames: Frames) -> Background:
    """Return what the camera sees between flashes: the median over frames at the start of the film.

    Raises:
        DatasetError: the film is too short, or flashes light most of its frames.
    """
    step = max(min(frames.count or _FIRST_FRAMES, _FIRST_FRAMES) // _SAMPLED, 1)
    sampled: list[Array] = []
    for number, frame in frames.read():
        # One frame of each step, not always the same, lest all show a flash of a strobe in step with them.
        if number % step == int(number // step * _GOLDEN % 1 * step) and frame is not None:
            sampled.append(frame)
        if len(sampled) == _SAMPLED:
            break
    if len(sampled) < 5:
        raise fail(str(frames.path), len(sampled), f"has {len(sampled)} frames; the background takes 5 without flash")
    stack = np.stack(sampled)
    middle = np.median(stack, axis=0)
    deviations = np.array([np.percentile(np.abs(one.astype(np.float32) - middle), 68.3) for one in stack])
    return Background(middle, max(float(np.median(deviations)), 0.3))


def flashes(frames: Frames, dark: Background, first: int = 0) -> Iterator[Flash]:
    """Return the flashes of a film in order, from frame ``first``, which must not be the second frame of a flash.

    Raises:
        DatasetError: three frames in a row are lit, so that flashes cannot be separated.
    """
    before: tuple[int, Array] | None = None
    run, lit_frames = 0, 0
    for seen, (number, frame) in enumerate(frames.read(first), 1):
        lit = frame is not None and dark.lit(frame)
        lit_frames += lit
        run = run + 1 if lit else 0
        if run > 2 or (seen > 50 and lit_frames > _MOST_LIT * seen):
            what = f"frame {number} is the third of three" if run > 2 else f"{lit_frames} of {seen} frames are those"
            raise fail(
                str(frames.path),
                number,
                f"{what} that are lit; a strobe must leave frames dark between flashes: flash at most at a third of "
                "the frame rate, or track with light: continuous",
            )
        if before is not None:
            second = frame if frame is not None else dark.image
            yield _merged(before[0], before[1], second, dark)
            before = None
        elif lit and frame is not None:
            before = (number, frame)
    if before is not None:
        yield _merged(before[0], before[1], dark.image, dark)


def _merged(number: int, first: Array, second: Array, dark: Background) -> Flash:
    one, two = (frame.astype(np.float32) - dark.image for frame in (first, second))
    threshold = max(_NOISES * dark.noise, _GREY_LEVELS)
    lights = [np.where(part > threshold, part, 0).sum(axis=1) for part in (one, two)]
    return Flash(FlashMark(number, *_split(*lights)), one + two, dark.noise * np.sqrt(2))


def _split(lower: Float[Array, " H"], upper: Float[Array, " H"]) -> tuple[float, tuple[float, float]]:
    """Return the row at which the light passes from the second frame, above, to the first, below, and its range."""
    total, rows = lower + upper, np.arange(len(lower))
    seen = rows[total > 0]
    if not len(seen):
        return 0.0, (-np.inf, np.inf)
    share = lower[seen] / total[seen]
    # Rows of both kinds may overlap by noise; the split is where as few as possible are on the wrong side.
    wrong = np.concatenate([[0], np.cumsum(share > 0.5)]) + np.concatenate([np.cumsum((share <= 0.5)[::-1])[::-1], [0]])
    best = int(np.argmin(wrong))
    # Where one frame has all the light, the split is somewhere beyond the rows with markers.
    low = float(seen[best - 1]) if best else -np.inf
    high = float(seen[best]) if best < len(seen) else np.inf
    return (low + high) / 2 if best and best < len(seen) else (high if not best else low), (low, high)


@dataclass(frozen=True, eq=False)
class FlashTimes:
    """When the flashes were, on the clock of one camera.

    Attributes:
        times: [N] (s), of a strobe with a steady period.
        numbers: [N], of the flashes, of which some may not have been seen.
        period: of the strobe (s).
        standard_deviation: of a flash about the steady period (s), as the frames show it.
        row_s: time from row to row (s), as stated or as the flashes show it.
    """

    times: Float[Array, " N"]
    numbers: Array
    period: float
    standard_deviation: float
    row_s: float


def flash_times(seen: Sequence[FlashMark], frames: Frames, row_s: float | None) -> FlashTimes:
    """Estimate the times of flashes with a steady period from their frames and rows.

    Least squares of ``frame / rate + row * row_s = start + number * period``; without ``row_s`` it is estimated too, if
    the flashes are at different rows.

    Raises:
        DatasetError: there are fewer than three flashes, or their period is not steady.
    """
    if len(seen) < 3:
        raise fail(str(frames.path), len(seen), f"shows {len(seen)} flashes; the period of a strobe takes three")
    at = np.array([one.frame for one in seen]) / frames.rate_hz
    numbers = _numbers(at, str(frames.path))
    low, high = np.array([one.between for one in seen]).T
    rows = np.array([one.split for one in seen])
    whole = np.isfinite(low) & np.isfinite(high)
    design = np.column_stack([np.ones(len(seen)), numbers])
    if row_s is None:
        row_s = _row_time(design[whole], at[whole], rows[whole], 1 / frames.rate_hz / frames.size_px[1])
    solution: Array = np.zeros(2)
    for _ in range(50):
        solution = np.asarray(np.linalg.lstsq(design, at + row_s * rows, rcond=None)[0], dtype=float)
        # A split beyond the markers is where the others place it, within its range.
        if row_s > 0:
            rows = np.where(whole, rows, np.clip((design @ solution - at) / row_s, low, high))
    residuals = at + row_s * rows - design @ solution
    deviation = float(np.sqrt((residuals**2).sum() / max(len(seen) - 3, 1)))
    if np.abs(residuals).max() > 2 / frames.rate_hz:
        worst = int(np.argmax(np.abs(residuals)))
        raise fail(
            str(frames.path),
            round(float(residuals[worst]), 4),
            f"the flash in frame {seen[worst].frame} is {abs(residuals[worst]) * 1e3:.1f} ms off a steady strobe, more "
            f"than two frames ({2e3 / frames.rate_hz:.1f} ms): check the strobe, or leave that part of the film out",
        )
    times = design @ solution
    return FlashTimes(np.asarray(times), numbers, float(solution[1]), deviation, row_s)


def _row_time(design: Array, at: Array, rows: Array, longest: float) -> float:
    """Return the time from row to row (s) that makes the flashes steady; zero if too few show it."""
    if len(at) < 5 or np.ptp(rows) < 20:
        return 0.0
    solution, *_ = np.linalg.lstsq(np.column_stack([design, -rows]), at, rcond=None)
    return float(np.clip(solution[2], 0.0, longest))


def _numbers(at: Float[Array, " N"], file: str) -> Array:
    """Return the numbers of flashes at the times ``at``, with the shortest interval as that between neighbours."""
    intervals = np.diff(at)
    if (intervals <= 0).any():
        raise fail(file, None, "flashes are not in order")
    # The mean, for which the rounding to frames cancels; a long gap would be miscounted with the median.
    period = float(np.mean(intervals[intervals < 1.5 * np.percentile(intervals, 20)]))
    return np.concatenate([[0], np.cumsum(np.maximum(np.rint(intervals / period), 1))]).astype(int)
