"""Recordings as a whole: duplicates, columns that never change, and how they are cut."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

import numpy as np

from wingfit.checks.harmonics import fit
from wingfit.checks.mistake import Mistake
from wingfit.records import AnyDataset, AnyRecording, Dataset, Recording
from wingfit.records.array_types import Array, Mask

WHOLE = 0.85  # beats: of less, a recording is remarked on
UNSTEADY = 0.45  # amplitude in one part of a recording over that in another
PARTS, HARMONICS = 8, 4


def check_recordings(dataset: AnyDataset) -> Iterator[Mistake]:
    """Yield duplicates, constant channels, and recordings that are not steady."""
    yield from _duplicates(dataset)
    for recording in dataset.recordings:
        yield from _constant(recording)
    if isinstance(dataset, Dataset):
        for recording in dataset.recordings:
            if (found := _unsteady(recording) or _single_beat(recording)) is not None:
                yield found


def _duplicates(dataset: AnyDataset) -> Iterator[Mistake]:
    seen: dict[str, AnyRecording] = {}
    for recording in dataset.recordings:
        digest = hashlib.sha256(np.ascontiguousarray(recording.values).tobytes()).hexdigest()
        first = seen.setdefault(digest, recording)
        if first is not recording:
            yield Mistake(
                "duplicate",
                f"recording {recording.name!r}",
                f"has exactly the samples of recording {first.name!r}",
                "samples of its own: two measurements are never the same to the last digit",
                "a file was copied or exported twice",
                f"recordings/{recording.name}.csv: put the right file there, or remove the recording from dataset.yaml",
            )


def _constant(recording: AnyRecording) -> Iterator[Mistake]:
    values = recording.values
    seen = np.isfinite(values)
    with np.errstate(all="ignore"):
        low, high = np.where(seen, values, np.inf).min(axis=0), np.where(seen, values, -np.inf).max(axis=0)
    flat = (seen.sum(axis=0) >= 8) & (low == high)
    moving = (low < high).any()
    names = [name for name, one in zip(recording.channels, flat, strict=True) if one]
    if not names or not moving:
        return
    axes = {name.rpartition("_")[2] for name in names}
    if (
        isinstance(recording, Recording)
        and recording.markers
        and len(names) == len(recording.markers)
        and len(axes) == 1
    ):
        return  # one axis of all markers: a camera that sees a plane; the shape of the wing says more
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    remedy = "empty or remove" if isinstance(recording, Recording) and recording.markers else "remove"
    yield Mistake(
        "constant channel",
        f"recording {recording.name!r}",
        f"{', '.join(names[:3])}{more} never change{'s' if len(names) == 1 else ''}",
        "values that change with the motion",
        "the channel was not connected, or the tracker held one position",
        f"recordings/{recording.name}.csv: {remedy} {'this column' if len(names) == 1 else 'these columns'}",
    )


def _single_beat(recording: Recording) -> Mistake | None:
    step = float(np.median(np.diff(recording.times)))
    beats = recording.condition.flap_frequency * (float(np.ptp(recording.times)) + step)
    if beats >= WHOLE:
        return None
    return Mistake(
        "cut",
        f"recording {recording.name!r}",
        f"covers {beats:.2g} of a beat of {1 / recording.condition.flap_frequency:.4g} s",
        "at least one beat; two or more show the noise",
        "the recording was cut too short, or flap_frequency_hz or the unit of time_s is wrong",
        f"recordings/{recording.name}.csv: add the rest of the beat; or flap_frequency_hz, or time_s",
    )


def _unsteady(recording: Recording) -> Mistake | None:
    """A rig that starts, stops or glides during a part of the recording: the amplitude there is far smaller."""
    sizes = gains(recording)
    if sizes is None or not np.nanmax(sizes) > 0:
        return None
    share = sizes / np.nanmedian(np.sort(sizes)[np.isfinite(np.sort(sizes)).sum() // 2 :])
    weak = share < UNSTEADY
    if not weak.any():
        return None
    times = recording.times
    edges = np.linspace(times[0], times[-1], len(sizes) + 1)
    parts = [f"{edges[k]:.4g} to {edges[k + 1]:.4g} s" for k in np.flatnonzero(weak)[:3]]
    first, last = _longest(~weak)
    return Mistake(
        "unsteady",
        f"recording {recording.name!r}",
        f"moves with {100 * max(np.nanmin(share), 0.0):.0f} % of its usual amplitude in a part ({', '.join(parts)})",
        "the same beat throughout",
        "the rig starts, stops or glides there",
        f"dataset.yaml, this recording: window_s: [{edges[first]:.6g}, {edges[last + 1]:.6g}], the longest part "
        "in which it flaps steadily",
    )


def _longest(steady: Mask) -> tuple[int, int]:
    """Return the first and the last place of the longest run of true values in ``steady`` [P], of which one is true."""
    ends = np.flatnonzero(np.diff(np.concatenate([[0], steady.astype(np.int8), [0]])))
    runs = [(int(start), int(end) - 1) for start, end in zip(ends[::2], ends[1::2], strict=True)]
    return max(runs, key=lambda run: run[1] - run[0])


def gains(recording: Recording) -> Array | None:
    """Return the size of the motion in each of PARTS parts of a recording, relative to the harmonics of all of it.

    NaN for a part in which these hardly change; None for a recording that is too short. A strobe shows a slow motion,
    so that a part may hold less than an apparent beat: its variance alone says nothing.
    """
    beats = recording.condition.flap_frequency * float(np.ptp(recording.times))
    parts = int(min(PARTS, len(recording.times) // 15, max(2 * beats, 0)))
    values = recording.values[:, np.isfinite(recording.values).mean(axis=0) > 0.6]
    if parts < 2 or not values.shape[1]:
        return None
    waves = fit(recording.times, values, recording.condition.flap_frequency, HARMONICS)
    seen, about = np.isfinite(values), values - waves.mean
    wave = np.where(seen, waves.at(recording.times, recording.condition.flap_frequency) - waves.mean, 0.0)
    edges = np.linspace(recording.times[0], recording.times[-1], parts + 1)
    part = np.clip(np.searchsorted(edges, recording.times, side="right") - 1, 0, parts - 1)
    product, square = (wave * np.where(seen, about, 0.0)).sum(axis=1), (wave**2).sum(axis=1)
    sums = np.array([[product[part == k].sum(), square[part == k].sum()] for k in range(parts)])
    enough = sums[:, 1] > 0.25 * sums[:, 1].mean()
    return np.where(enough, sums[:, 0] / np.where(enough, sums[:, 1], 1.0), np.nan)
