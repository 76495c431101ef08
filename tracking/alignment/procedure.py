"""From tracks in camera axes to the wing's frame: the steps of an alignment, and when it refuses."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from wingfit.records.array_types import Array, Index
from wingfit.records.errors import DatasetError, fail
from wingfit.records.wing import Wing
from wingfit.tracking.alignment.arrangements import DISTINCT, LEAST_MARKERS, Arrangement, Search, ranked
from wingfit.tracking.alignment.candidates import gate_of, layout_of, with_all
from wingfit.tracking.alignment.fit import Fit, fit, shaken, states_of
from wingfit.tracking.alignment.flapping import Flapping, drive_series, half_range, refined, true_frequency
from wingfit.tracking.alignment.identity import exchanges, frame_by_frame, gathered
from wingfit.tracking.alignment.preparation import Prepared, described_of, prepared
from wingfit.tracking.alignment.report import Frame, aligned
from wingfit.tracking.alignment.request import LEAST_TRACKS, Known, Tracks, checked
from wingfit.tracking.alignment.result import AlignedTracks, DroppedTrack
from wingfit.tracking.alignment.rigid_motion import RigidMotion
from wingfit.tracking.alignment.shake import body_part
from wingfit.tracking.alignment.wing_model import Strip, positions, strip_of

_CHUNK = 2000
_PREPARED, _SEARCHED = 0.2, 0.8  # parts of the work, about
_AMPLITUDES = (0.6, 1.7)  # ratio of the flap amplitude to that of the drive
_LEAST_EXPLAINED = 0.8  # of the variance of the flap angle, by one period
_MOST_NOISE, _MOST_SCATTER = 0.015, 0.0099  # spans
_LEAST_MATCHED = 0.6  # of the tracks that move with the wing
_LEAST_SAMPLES = 8
_LEAST_UP = 0.2


def align(
    tracks: Tracks, wing: Wing, known: Known, report: Callable[[float], object] = lambda _: None
) -> AlignedTracks:
    """Align ``tracks`` of ``wing`` to its frame, with what the user states, ``known``.

    ``report`` is called with the part of the work that is done, from 0 to 1.

    Raises DatasetError, with what would settle it, if the tracks cannot be those of the wing, or if the frame, the side
    or the labels are not certain.
    """
    checked(tracks, wing)
    known.check(tracks, wing)
    found = prepared(tracks, wing, known)
    strip, described = strip_of(wing), described_of(wing)
    report(_PREPARED)
    best, evidence = _arranged(found, wing, strip, described, known, report)
    report(_SEARCHED)
    return _finished(found, wing, strip, described, best, evidence, known)


def _given(found: Prepared, wing: Wing, known: Known) -> tuple[Index, Index]:
    """Markers [K] by the tracks' names, and those that the user stated; -1 for none."""
    number = {marker.name: m for m, marker in enumerate(wing.markers)}
    stated = np.array([number[known.labels[name]] if name in known.labels else -1 for name in found.tracks.names])
    if known.ignore_names:
        return stated, stated
    named = [number.get(known.labels.get(name, name), -1) for name in found.tracks.names]
    return np.array(named), stated


def _arranged(
    found: Prepared, wing: Wing, strip: Strip, described: Array, known: Known, report: Callable[[float], object]
) -> tuple[Arrangement, float | None]:
    tracks, motion = found.tracks, found.motion
    points = tracks.positions[found.frames]
    search = Search(strip, described, points, motion, layout_of(motion), found.of_frames)
    named, stated = _given(found, wing, known)
    up, every, excluded = known.up_vector(), list[Arrangement](), list[Arrangement]()
    tried = search.candidates(named)
    for done, candidate in enumerate(tried):
        report(_PREPARED + (_SEARCHED - _PREPARED) * done / len(tried))
        for right in (True, False):
            one = search.arranged(candidate, right, stated, named)
            if one is None:
                continue
            allowed = known.side in (None, "right" if right else "left") and (up is None or _up(one.fit, up) > 0)
            group = every if allowed else excluded
            if not any(other.fit.right == right and np.array_equal(other.marker, one.marker) for other in group):
                group.append(one)
    if not every:
        remedy = "check the described positions and the unit, or the directions that you gave"
        near = max(((one.marker >= 0).sum() for one in tried), default=0)
        message = (
            f"no arrangement of the described markers fits the tracks: at most {near} of {len(tracks.names)} are near"
        )
        raise fail(tracks.file, None, f"{message} one at a time, and after a fit fewer than {LEAST_MARKERS}; {remedy}")
    best, evidence = _best(every, described, named, tracks, wing)
    _check_stated(best, excluded, described, known)
    return best, evidence if known.side is None and up is None else None


def _check_stated(best: Arrangement, excluded: list[Arrangement], described: Array, known: Known) -> None:
    """Raise DatasetError if what the user said about the side contradicts the tracks."""
    costs = {id(one): cost for cost, one in ranked([best, *excluded], described)}
    worse = max((costs[id(best)] - costs[id(one)] for one in excluded), default=0.0)
    if worse > DISTINCT:
        stated, value = ("--side", known.side) if known.side else ("--up", known.up)
        message = (
            f"the tracks are those of a {'left' if best.fit.right else 'right'} wing: ln of the odds against "
            f"{stated} {value} is {worse / 2:.3g}, and at most {DISTINCT / 2:g} is accepted. Leave {stated} away; if "
            "it is right, the axes of the tracks are left-handed, or z of the described markers has the wrong sign"
        )
        raise fail(stated, value, message)


def _up(one: Fit, up: Array) -> float:
    along = float(one.turn[2] @ up)
    if abs(along) < _LEAST_UP:
        message = f"is {np.degrees(np.arccos(abs(along))):.0f} deg from the wing's vertical; give --side instead"
        raise fail("--up", None, message)
    return along


def _best(
    every: list[Arrangement], described: Array, named: Index, tracks: Tracks, wing: Wing
) -> tuple[Arrangement, float]:
    """Return the best arrangement, and the evidence for its side; DatasetError if another one is nearly as good."""
    order = ranked(every, described)
    agreeing = [pair for pair in order if _agrees(pair[1], named)]
    if agreeing and agreeing[0][0] < DISTINCT and (named >= 0).sum() >= 3:
        order = [(cost - agreeing[0][0], one) for cost, one in agreeing]  # names decide between what fits equally
    (_, best), others = order[0], order[1:]
    evidence = np.inf
    for cost, other in others:
        both = (best.marker >= 0) & (other.marker >= 0)
        labels = np.flatnonzero(both & (best.marker != other.marker))
        if len(labels) == 0 and other.fit.right != best.fit.right:
            evidence = min(evidence, cost)
        if cost > DISTINCT:
            continue
        if len(labels) == 0 and other.fit.right != best.fit.right:
            raise _side_open(tracks.file, cost)
        if len(labels) > 0:
            raise _labels_open(tracks, wing, best, other, labels, cost)
    return best, float(evidence)


def _agrees(one: Arrangement, named: Index) -> bool:
    both = (named >= 0) & (one.marker >= 0)
    return bool((named[both] == one.marker[both]).all())


def _side_open(file: str, cost: float) -> DatasetError:
    message = (
        f"a left and a right wing explain the tracks nearly equally well (ln of the odds {cost / 2:.2g}, "
        f"{DISTINCT / 2:g} are needed), as the markers lie nearly in the plane of the hinge: add --side left or --side "
        "right, or the axis of the tracks that is up, --up z"
    )
    return fail(file, None, message)


def _labels_open(
    tracks: Tracks, wing: Wing, best: Arrangement, other: Arrangement, labels: Index, cost: float
) -> DatasetError:
    k = int(labels[np.argmax(np.linalg.norm(best.fit.rest, axis=1)[: len(labels)])]) if len(labels) else 0
    names = [wing.markers[one.marker[k]].name for one in (best, other)]
    message = (
        f"two ways to lay the described markers on the tracks explain them nearly equally well (ln of the odds "
        f"{cost / 2:.2g}, {DISTINCT / 2:g} are needed), and differ in {len(labels)} labels: track {tracks.names[k]!r} "
        f"is {names[0]!r} or {names[1]!r}; say which: --label {tracks.names[k]}={names[0]}"
    )
    return fail(tracks.file, None, message)


def _finished(
    found: Prepared,
    wing: Wing,
    strip: Strip,
    described: Array,
    best: Arrangement,
    evidence: float | None,
    known: Known,
) -> AlignedTracks:
    """Repair labels frame by frame, fit again, set the zero of the flap angle, and collect the result."""
    tracks, remarks = found.tracks, list(found.remarks)
    marker = np.where(best.doubtful, -1, best.marker)
    _check_match(tracks, best, found.motion, strip)
    points = np.where(best.doubtful[None, :, None], np.nan, tracks.positions)
    flap = found.flap_angles(best.fit.states[:, 0])
    gate = gate_of(described[:, :2])
    which = best.marker[best.marker >= 0]
    rest = described.copy()
    rest[which] = best.fit.rest
    shown = np.full((len(points), len(described)), -1)
    for start in range(0, len(points), _CHUNK):
        part = slice(start, start + _CHUNK)
        mine, slow = points[part][:, best.marker >= 0], found.slow[part]
        states, moved = states_of(strip, mine, best.fit, found.shaking, slow, flap[part])
        model = positions(strip, rest, states, best.fit.line)[0]
        model += shaken(model, moved)
        shown[part] = frame_by_frame(best.fit.coordinates(points[part]), model, marker, best.fit.noise, gate)
    shown[:, (shown >= 0).sum(axis=0) < _LEAST_SAMPLES] = -1
    used = np.flatnonzero((shown >= 0).any(axis=0))
    mine = gathered(tracks.positions, shown[:, used])
    initial = with_all(best.fit, rest[used])
    final = fit(strip, described[used], mine[found.frames], found.of_frames, initial)
    _check_fit(tracks.file, final, strip)
    if known.body or found.slow.size:
        mine = _steadied(mine, strip, final, found)
    flapping = found.flapping_by(final.states[:, 0], found.flapping.frequency)
    frequency = _frequency(tracks, refined(tracks.times, mine, flapping.frequency), known)
    zero = _zero(tracks.file, wing, flapping, known)
    names = tuple(one.name for one in wing.markers)
    changed = exchanges(shown, best.marker, tracks.times, tracks.names, names)
    lost = int(np.isfinite(points[:, marker >= 0, 0]).sum() - (shown[:, :, None] == np.flatnonzero(marker >= 0)).sum())
    dropped = _dropped(tracks, shown, best, wing)
    named, _ = _given(found, wing, known)
    remarks += _relabelled(tracks, wing, named, best.marker)
    turned = Rotation.from_rotvec([flapping.harmonics[0].real - zero, 0.0, 0.0]).as_matrix().T @ final.turn
    frame = Frame(turned, final.hinge, flapping, frequency, zero, evidence)
    return aligned(tracks, wing, final, frame, used, shown, mine, changed, dropped, lost, remarks)


def _frequency(tracks: Tracks, apparent: float, known: Known) -> float:
    """Return the ``apparent`` frequency (Hz), or the true one if the user said what it is about."""
    if known.flap_frequency_hz is None:
        return apparent
    step = float(np.median(np.diff(tracks.times)))
    found = true_frequency(apparent, step, known.flap_frequency_hz)
    if found is None:
        message = (
            f"the frames show {apparent:.5g} Hz at {1 / step:.5g} frames per second, which no frequency within 2 % of "
            f"{known.flap_frequency_hz:g} Hz explains, or two do: check the frequency, and the times of the frames"
        )
        raise fail("--flap-frequency-hz", known.flap_frequency_hz, message)
    return found


def _steadied(mine: Array, strip: Strip, final: Fit, found: Prepared) -> Array:
    """Return positions [T, M, 3] of the markers, m, without what remains of the body's motion."""
    flap = found.flap_angles(final.states[:, 0])
    pose = found.shaking.covariance(final.turn, final.hinge)
    result = mine.copy()
    for start in range(0, len(mine), _CHUNK):
        part = slice(start, start + _CHUNK)
        states, moved = states_of(strip, mine[part], final, found.shaking, found.slow[part], flap[part])
        model = positions(strip, final.rest, states, final.line)[0]
        drift = found.slow[part] @ final.drift
        moved = drift + body_part(moved - drift, pose, final.shake, final.memory)
        result[part] -= shaken(model, moved) @ final.turn
    return result


def _check_match(tracks: Tracks, best: Arrangement, motion: RigidMotion, strip: Strip) -> None:
    moving = motion.weight > 0.5
    matched = int(((best.marker >= 0) & moving).sum())
    if matched < _LEAST_MATCHED * moving.sum() or matched < LEAST_TRACKS:
        message = (
            f"only {matched} of {int(moving.sum())} tracks that move with the wing are near a described marker; at "
            f"least {100 * _LEAST_MATCHED:.0f} % and {LEAST_TRACKS} are needed: check the described positions"
        )
        raise fail(tracks.file, matched, message)
    _check_fit(tracks.file, best.fit, strip)


def _check_fit(file: str, one: Fit, strip: Strip) -> None:
    if one.noise > _MOST_NOISE * strip.span:
        message = (
            f"the tracks differ from the described wing by {1e3 * one.noise:.3g} mm in the best arrangement; at most "
            f"{1e3 * _MOST_NOISE * strip.span:.3g} mm (1.5 % of the span) are accepted: is it this wing, does its body "
            "move (--body), does it fold or bend along the chord?"
        )
        raise fail(file, None, message)
    if one.scatter > _MOST_SCATTER * strip.span:
        message = (
            f"the described rest positions differ by {1e3 * one.scatter:.3g} mm or more from the tracks; at most 1 % "
            "of the span is accepted: measure the markers again, or check the labels"
        )
        raise fail(file, None, message)


def _zero(file: str, wing: Wing, flapping: Flapping, known: Known) -> float:
    """Return the mean flap angle over the beat (rad); DatasetError if it is not known."""
    if known.mean_flap_deg is not None:
        return float(np.radians(known.mean_flap_deg))
    series = drive_series(wing.drive)
    remedy = "the zero of the flap angle is then unknown; give the mean angle over the beat: --mean-flap-deg"
    if flapping.explained < _LEAST_EXPLAINED:
        share = f"one period explains {100 * flapping.explained:.0f} % of the variance of the flap angle"
        raise fail(file, None, f"{share}, {100 * _LEAST_EXPLAINED:.0f} % are needed: {remedy}")
    measured, described = half_range(flapping.harmonics), half_range(series)
    if not _AMPLITUDES[0] < measured / max(described, 1e-9) < _AMPLITUDES[1]:
        sizes = (
            f"the wing flaps by +-{np.degrees(measured):.3g} deg, the described drive by +-{np.degrees(described):.3g}"
        )
        raise fail(file, None, f"{sizes} deg: {remedy}")
    return float(series[0].real)


def _dropped(tracks: Tracks, shown: Index, best: Arrangement, wing: Wing) -> list[DroppedTrack]:
    result = list[DroppedTrack]()
    for k, name in enumerate(tracks.names):
        if (shown == k).any():
            continue
        if not np.isfinite(tracks.positions[:, k]).any():
            reason = "never seen while the others are"
        elif best.doubtful[k]:
            near = np.argsort(best.away[k])[:2]
            reason = "may be " + " or ".join(wing.markers[m].name for m in near)
        else:
            m = int(np.argmin(best.away[k]))
            reason = f"near no free marker; {1e3 * best.away[k, m]:.3g} mm or more from {wing.markers[m].name}"
        result.append(DroppedTrack(name, reason))
    return result


def _relabelled(tracks: Tracks, wing: Wing, named: Index, marker: Index) -> list[str]:
    wrong = np.flatnonzero((named >= 0) & (marker >= 0) & (named != marker))
    return [f"track {tracks.names[k]!r} is marker {wing.markers[marker[k]].name!r}: its name is wrong" for k in wrong]
