"""Forces of a vehicle against a quasi-steady model of the described wings: axes, signs, unit, phase, motion, condition.

If no coefficients within wide limits come near the recorded beat, and one of the usual mistakes, undone, lets them come
much nearer, the mistake is named. That is a warning, never a refusal: an experiment may have strong physics that the
model does not have. On the plants of the concealed trials, with such physics, the model leaves 0 to 60 % of the forces.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from wingfit.checks.force_columns import LATE, ColumnMistake, best_shift, column_mistakes
from wingfit.checks.mistake import EVERY, Edit, KeyEdit, Kind, Mistake, change_of
from wingfit.checks.motion import HYPOTHESES as MOTIONS
from wingfit.checks.motion import body_pitches
from wingfit.checks.quasi_steady import Beat, beat_of, enough, fitted, left_of
from wingfit.checks.single_forces import check_single_forces
from wingfit.records import Dataset
from wingfit.records.array_types import Array

RECORDINGS = 3  # that are compared
LEFT = 0.75  # of the forces, residual of the model at least where a mistake is looked for
SUSPECT = 0.35  # from here on, if it then leaves next to nothing
EXPLAINED = 0.1  # residual with which no other mistake is looked for
BETTER, FAR_BETTER = 0.5, 0.2  # of that, the residual at most with the mistake undone
# Weights: distance of the mean force from the weight. Flights of the trials have 0.1 to 0.7, as models lack lift.
TRIMMED, UNTRIMMED, NEARER = 0.65, 0.9, 0.6


def check_forces(dataset: Dataset) -> Iterator[Mistake]:
    """Yield the likeliest mistake in the forces of a vehicle, or one for each recording that has its own."""
    chosen = list(enumerate(dataset.recordings))[:: max(1, len(dataset.recordings) // RECORDINGS)][:RECORDINGS]
    beats = [beat_of(dataset.vehicle, recording, index) for index, recording in chosen if enough(recording)]
    if beats:
        found = list(_together(dataset, beats)) or list(check_single_forces(dataset))
        yield from found or _trim(dataset)


def _together(dataset: Dataset, beats: Sequence[Beat]) -> Iterator[Mistake]:
    """Yield the likeliest mistake that all recordings have, as ``beats`` of some of them show."""
    given = _left(beats)
    if given <= SUSPECT:
        return
    found = _rearranged(dataset, beats, given)
    if found is None or found[0] > EXPLAINED:
        # Exchanged columns may imitate a wrong motion; the motion itself then explains far more.
        other = _described(dataset, beats, given)
        found = other if other and (found is None or other[0] < 0.6 * found[0]) else found
    if found is not None:
        yield found[1]


def _enough_better(given: float) -> float:
    """Part of the forces that may be left with the mistake undone, if ``given`` is left with it."""
    return (BETTER if given > LEFT else FAR_BETTER) * given


def _left(beats: Sequence[Beat], undo: Callable[[Array], Array] = np.asarray) -> float:
    """Return the part of the forces, changed by ``undo``, that no coefficients explain: median over recordings."""
    undone = [replace(beat, forces=undo(beat.forces)) for beat in beats]
    return float(np.median([left_of(beat, fitted([beat])) for beat in undone]))


def _rearranged(dataset: Dataset, beats: Sequence[Beat], given: float) -> tuple[float, Mistake] | None:
    """Mistakes in the columns: axes, signs, unit, start of the beat. The simplest one that explains most."""

    def left(one: ColumnMistake) -> float:
        return _left(beats, one.undo)

    both = all(len(beat.recording.forces) == 2 for beat in beats)
    axes = {axis for beat in beats for axis in beat.recording.forces}
    shift = best_shift(left)
    shifts = [shift] if abs(shift.beats) > LATE else []
    tried = [(left(one), one) for one in (*column_mistakes(axes, both=both), *shifts)]
    tried = [one for one in tried if one[0] < _enough_better(given)]
    if not tried:
        return None
    least = min(part for part, _ in tried)
    near = (one for one in tried if one[0] < 1.6 * least + 0.02)
    part, found = min(near, key=lambda one: (one[1].rank, one[0]))
    edits = tuple(found.edit(recording) for recording in dataset.recordings)
    return part, _mistake(found.kind, given, part, found.cause, edits)


def _mistake(kind: Kind, given: float, left: float, cause: str, edits: tuple[Edit, ...]) -> Mistake:
    return Mistake(
        kind,
        EVERY,
        f"a quasi-steady model of the described wings explains {100 * max(0.0, 1 - given):.0f} % of the forces at most",
        f"{100 * (1 - left):.0f} %, as with the change",
        cause,
        change_of(edits),
        False,
        edits,
    )


def _described(dataset: Dataset, beats: Sequence[Beat], given: float) -> tuple[float, Mistake] | None:
    """Mistakes in the description of motion and conditions, each undone in turn."""
    best: tuple[float, Mistake] | None = None
    for hypothesis in MOTIONS:
        changed = hypothesis.change(dataset)
        if changed is None:
            continue
        try:
            again = [beat_of(changed.vehicle, changed.recordings[one.index], one.index) for one in beats]
        except (ValueError, ArithmeticError):
            continue
        left = _left([replace(new, forces=old.forces) for new, old in zip(again, beats, strict=True)])
        if left < _enough_better(given) and (best is None or left < best[0]):
            edits = hypothesis.edits(dataset)
            best = left, _mistake(hypothesis.kind, given, left, hypothesis.cause, edits)
    return best


def _trim(dataset: Dataset) -> Iterator[Mistake]:
    """In level flight the mean force is the weight: a body pitch in another unit turns it away from the vertical."""
    usable = [one for one in dataset.recordings if len(one.forces) == 2 and one.condition.gravity > 0]
    if len(usable) < 2:
        return
    means = np.array([np.nanmean(one.values, axis=0) for one in usable])
    weights = np.array([one.condition.gravity * (one.mass or dataset.vehicle.mass) for one in usable])
    pitch = np.array([one.condition.angle_of_attack for one in usable])
    given = _untrimmed(means, weights, pitch)
    if given < UNTRIMMED:
        return
    indices = [dataset.recordings.index(one) for one in usable]
    for new, cause in body_pitches(pitch):
        if np.abs(new).max() <= np.pi / 2 * 1.01 and _untrimmed(means, weights, new) < min(TRIMMED, NEARER * given):
            edits = tuple(
                KeyEdit(("recordings", k, "body_pitch_deg"), f"{np.degrees(a):.6g}", f"{np.degrees(b):.6g}")
                for k, a, b in zip(indices, pitch, new, strict=True)
            )
            yield Mistake(
                "body pitch", "dataset.yaml: recordings[*].body_pitch_deg",
                f"the mean force differs from a force upwards of one weight by {given:.2g} weights",
                f"{_untrimmed(means, weights, new):.2g} weights, as with the change", cause, change_of(edits), False,
                edits,
            )  # fmt: skip
            return
    lift = (means[:, 0] * np.sin(pitch) - means[:, 1] * np.cos(pitch)) / weights
    if np.median(lift) < -0.3:
        yield Mistake(
            "weight", EVERY, f"the mean force is {-np.median(lift):.2g} weights downwards",
            "a force upwards that carries the weight, if the vehicle flies",
            "the sign of the forces or of the body pitch: x to the nose, z down",
            "the sign of force_x_n or force_z_n, or body_pitch_deg",
        )  # fmt: skip


def _untrimmed(means: Array, weights: Array, pitch: Array) -> float:
    """Median distance (weights) of the mean force from one weight upwards."""
    lift = (means[:, 0] * np.sin(pitch) - means[:, 1] * np.cos(pitch)) / weights
    drag = (means[:, 0] * np.cos(pitch) + means[:, 1] * np.sin(pitch)) / weights
    return float(np.median(np.hypot(lift - 1.0, drag)))
