"""The flap angle of tracks against the described drive: amplitude, mean, up and down, and lag of the rear rod.

The markers nearest to the hinge move almost as the driving rods do: on the plants of the concealed trials the
amplitudes agree within 20 % and the means within 0.02 rad. A resonance may change the first, not by the same factor at
all frequencies.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from wingfit.checks.harmonics import fit
from wingfit.checks.mistake import EVERY, Edit, KeyEdit, Mistake, TableEdit, change_of
from wingfit.checks.tracked import HARMONICS, Tracked
from wingfit.records import FourBarDrive, Wing
from wingfit.records.array_types import Array

RADIANS = 180.0 / np.pi
LOW, HIGH = 0.6, 1.7  # amplitude over that of the drive: beyond, a warning
ABSURD = 8.0  # factor between both amplitudes beyond which no elastic wing can move so
ALIKE = 0.12  # relative scatter between recordings of a factor that is due to the description
MEAN = 0.3  # rad, between mean flap angle and that of the drive: beyond, a warning
UPSIDE_DOWN, CLEARLY = 0.05, 0.35  # rad from the drive as given; of this, that of the drive upside down
UP_TO_DOWN = np.array([1.0, 1.0, -1.0])
MOST_UNSEEN = 0.25  # of the beat without a frame: harmonics that are not seen there could be anything
LEAST_LAG = np.radians(2.0)  # of stated lags: their range that shows a trend
# Measured lag of the markers per stated lag, of 34 plants 0.2 to 0.9: the foam takes up a part.
LAG_SLOPE = (-0.1, 3.0)


def check_drive(tracks: Sequence[Tracked], indices: Sequence[int]) -> Iterator[Mistake]:
    """Yield mistakes in the drive of a wing, from all its recordings; ``indices`` are their places in the dataset."""
    good = [one for one in tracks if _moves(one)]
    if not good:
        return
    amplitude = _amplitude(good)
    if amplitude:
        yield amplitude
    elif (found := _upside_down(good)) or (found := _mean(good)):
        yield found
    yield from _lag(tracks, indices)


def distance(tracked: Tracked) -> float:
    """Distance (rad) between tracks and drive in mean flap angle and in the second harmonic relative to the first."""
    return float(np.linalg.norm(_features(tracked) - _described(tracked)))


def _moves(tracked: Tracked) -> bool:
    """Whether the tracks and the drive flap, and the frames show the beat well enough to compare the two."""
    waves = tracked.flap.waves
    seen = tracked.times[np.isfinite(tracked.angle)]
    if len(seen) < 2 * (2 * HARMONICS + 1) or _widest_gap(seen * tracked.frequency) > MOST_UNSEEN:
        return False
    return bool(np.isfinite(waves).all() and abs(waves[0, 0]) > 1e-3 and abs(tracked.driven[1]) > 1e-6)


def _widest_gap(beats: Array) -> float:
    """Return the largest part of the beat, as a fraction, at whose phases there is no frame; ``beats`` [T]: times."""
    phases = np.sort(beats % 1.0)
    return float(np.diff(phases, append=phases[0] + 1.0).max())


def _features(tracked: Tracked) -> Array:
    mean, waves, _ = tracked.flap
    return _turned(float(mean[0]), complex(waves[0, 0]), complex(waves[1, 0]))


def _described(tracked: Tracked) -> Array:
    drive = tracked.driven
    return _turned(float(drive[0].real), complex(drive[1]), complex(drive[2]))


def _turned(mean: float, first: complex, second: complex) -> Array:
    """Mean and second harmonic (real, imaginary; rad), the latter where the first is at its maximum."""
    size = abs(first) or 1.0
    relative = second * (np.conj(first) / size) ** 2
    return np.array([mean, relative.real, relative.imag])


def _amplitude(tracks: Sequence[Tracked]) -> Mistake | None:
    ratios = np.array([abs(one.flap.waves[0, 0]) / abs(one.driven[1]) for one in tracks])
    ratio, wing = float(np.median(ratios)), tracks[0].wing
    if LOW < ratio < HIGH:
        return None
    steady = bool(np.ptp(np.log(ratios)) < 2 * ALIKE)
    measured, described = (np.degrees(np.median([abs(x) for x in these])) for these in zip(
        *((one.flap.waves[0, 0], one.driven[1]) for one in tracks), strict=True))  # fmt: skip
    factor, cause = _factor(ratio)
    edits = _scaled(wing, factor) if factor and steady else ()
    return Mistake(
        "amplitude",
        "dataset.yaml: wing.drive",
        f"the drive flaps with an amplitude of {described:.3g} deg, the markers near the hinge with {measured:.3g} deg",
        f"{measured:.3g} deg, within {100 * (HIGH - 1):.0f} %",
        cause,
        change_of(edits) if edits else "the drive in dataset.yaml, so that it flaps as the inner markers do",
        steady and bool(edits) and not 1 / ABSURD < ratio < ABSURD,
        edits,
    )


def _factor(ratio: float) -> tuple[float | None, str]:
    for factor, cause in (
        (RADIANS, "the angles of the drive are in radians, in keys named _deg"),
        (1 / RADIANS, "the angles of the drive were converted to degrees twice"),
        (0.5, "the drive has the whole range of the angle (peak to peak) in place of its amplitude"),
        (2.0, "the drive has half of the amplitude"),
    ):
        if abs(np.log(ratio / factor)) < 0.3:
            return factor, cause
    return None, "the drive is not the one that was recorded, or the hinge is elsewhere"


def _scaled(wing: Wing, factor: float) -> tuple[Edit, ...]:
    """Edits that multiply all angles of a Fourier drive by ``factor``; none for a linkage."""
    if isinstance(wing.drive, FourBarDrive):
        return ()
    edits = list[Edit]()
    lists = {"cosine_deg": wing.drive.cosine, "sine_deg": wing.drive.sine}
    means = () if factor in (0.5, 2.0) else ((("wing", "drive", "mean_deg"), wing.drive.mean),)
    values = [*means, *((("wing", "drive", key, k), x) for key, xs in lists.items() for k, x in enumerate(xs))]
    for path, value in values:
        if value:
            edits.append(KeyEdit(path, f"{np.degrees(value):.6g}", f"{np.degrees(value) * factor:.6g}"))
    return tuple(edits)


def _upside_down(tracks: Sequence[Tracked]) -> Mistake | None:
    """The sign of z, or of the drive: a mean angle and a second harmonic tell up from down."""
    given = np.array([distance(one) for one in tracks])
    turned = np.array([distance(one.moved(one.positions * UP_TO_DOWN)) for one in tracks])
    driven = np.array([np.linalg.norm(_features(one) + _described(one)) for one in tracks])
    by_drive = bool(np.median(driven) < np.median(turned)) and not isinstance(tracks[0].wing.drive, FourBarDrive)
    other = driven if by_drive else turned
    if not (np.all(other < CLEARLY * given) and np.median(given) > UPSIDE_DOWN):
        return None
    edits: tuple[Edit, ...] = tuple(TableEdit(r.recording.name, "columns *_z_m", "z", "-z", _z_turned) for r in tracks)
    if by_drive:
        edits = _scaled(tracks[0].wing, -1.0)
    return Mistake(
        "vertical sign",
        "dataset.yaml: wing.drive" if by_drive else EVERY,
        f"the flap angle differs from the drive's by {np.median(given):.3g} rad in mean and second harmonic",
        f"{np.median(other):.3g} rad, as with the sign of {'the drive' if by_drive else 'z'} changed",
        "the drive's angle is positive downwards" if by_drive else "z points down in the tracks",
        change_of(edits),
        False,
        edits,
    )


def _z_turned(times: Array, values: Array, names: tuple[str, ...]) -> tuple[Array, Array]:  # noqa: ARG001
    return times, values * np.tile(UP_TO_DOWN, values.shape[1] // 3)


def _mean(tracks: Sequence[Tracked]) -> Mistake | None:
    means = np.array([float(one.flap.mean[0]) for one in tracks])
    described, measured, wing = float(tracks[0].driven[0].real), float(np.median(means)), tracks[0].wing
    if abs(measured - described) < MEAN:
        return None
    edits, cause = tuple[Edit, ...](), "another zero of the drive's angle, or a hinge that is not horizontal at zero"
    drive = wing.drive
    linkage = isinstance(drive, FourBarDrive)
    key, stated = ("offset_deg", drive.offset) if isinstance(drive, FourBarDrive) else ("mean_deg", drive.mean)
    for new, why in (
        (stated * RADIANS, "the angle is in radians, in a key named _deg"),
        (-stated, "the angle has the wrong sign"),
        (stated / RADIANS, "the angle was converted to degrees twice"),
    ):
        # The mean follows the offset one for one, within a turn.
        mean = described - stated + new
        if abs(np.angle(np.exp(1j * (mean - measured)))) < MEAN / 2:
            edits = (KeyEdit(("wing", "drive", key), f"{np.degrees(stated):.6g}", f"{np.degrees(new):.6g}"),)
            cause = why
            break
    what = "offset of the linkage" if linkage else "mean angle of the drive"
    return Mistake(
        "mean angle",
        f"dataset.yaml: wing.drive.{key}",
        f"the mean flap angle is {np.degrees(measured):.3g} deg, that of the drive {np.degrees(described):.3g} deg",
        f"the same within {np.degrees(MEAN):.0f} deg",
        cause,
        change_of(edits) if edits else f"the {what} in dataset.yaml: {key}",
        bool(edits) and abs(measured - described) > 3 * MEAN,
        edits,
    )


def _lag(tracks: Sequence[Tracked], indices: Sequence[int]) -> Iterator[Mistake]:
    """Compare the lag between front and rear of the wing with that stated, over the recordings."""
    stated = np.array([one.recording.condition.phase_lag for one in tracks])
    measured = np.array([lag_of(one) for one in tracks])
    seen = np.isfinite(measured)
    if seen.sum() < 3 or np.ptp(stated[seen]) == 0:
        return
    slope, _ = np.polyfit(stated[seen], measured[seen], 1)
    scatter = float(np.std(measured[seen] - np.polyval(np.polyfit(stated[seen], measured[seen], 1), stated[seen])))
    change = abs(slope) * np.ptp(stated[seen])
    if change < 3 * scatter or change < np.radians(0.5):
        return
    if LAG_SLOPE[0] <= slope <= LAG_SLOPE[1] or (slope < 0 and np.ptp(stated) < LEAST_LAG):
        return
    radians = slope > LAG_SLOPE[1] and bool(np.abs(stated).max() * RADIANS < np.pi)
    factor = RADIANS if radians else -1.0
    cause = "the sign of the lag: positive where the rear rod follows"
    if radians:
        cause = "the lag is in radians, in a key named _deg"
    if slope > LAG_SLOPE[1] and not radians:
        return
    edits = tuple(
        KeyEdit(("recordings", index, "phase_lag_deg"), f"{np.degrees(lag):.6g}", f"{np.degrees(lag) * factor:.6g}")
        for index, lag in zip(indices, stated, strict=True)
        if lag
    )
    yield Mistake(
        "phase lag",
        "dataset.yaml: recordings[*].phase_lag_deg",
        f"the rear of the wing lags {slope:.3g} times as much as is stated (fitted over {int(seen.sum())} recordings)",
        "0.2 to 1 times",
        cause,
        change_of(edits),
        False,
        edits,
    )


def lag_of(tracked: Tracked) -> float:
    """Lag (rad) of the rear rod behind the front one at the inner third of the markers; NaN if it is not visible."""
    if not tracked.wing.driven_rods:
        return float("nan")
    rods = {rod.name: rod for rod in tracked.wing.rods}
    front, rear = (rods[name].x_root for name in tracked.wing.driven_rods)
    arms = tracked.rest - tracked.hinge
    inner = np.argsort(np.hypot(arms[:, 1], arms[:, 2]), kind="stable")[: max(6, len(arms) // 3)]
    if len(inner) < 4 or np.ptp(tracked.rest[inner, 0]) == 0 or front == rear:
        return float("nan")
    heights = tracked.positions[:, inner, 2] / np.hypot(arms[inner, 1], arms[inner, 2])
    first = fit(tracked.times, heights, tracked.frequency, HARMONICS).waves[0]
    known = np.abs(first) > 1e-6
    if known.sum() < 4:
        return float("nan")
    basis = np.column_stack([np.ones(known.sum()), tracked.rest[inner[known], 0]]).astype(complex)
    line = np.linalg.lstsq(basis, first[known], rcond=None)[0]
    ends = line[0] + line[1] * np.array([front, rear])
    return float(-np.angle(ends[1] / ends[0])) if abs(ends[0]) > 0 else float("nan")
