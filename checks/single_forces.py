"""A mistake in the forces of one recording, which the other recordings show.

Coefficients that fit the other recordings predict the forces of this one. If they miss most of them, and one of the
usual mistakes, undone in this recording alone, makes them come as near as in the others, the mistake is named.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wingfit.checks.force_columns import LATE, ColumnMistake, best_shift, column_mistakes
from wingfit.checks.mistake import Edit, KeyEdit, Kind, Mistake, change_of
from wingfit.checks.motion import body_pitches
from wingfit.checks.quasi_steady import Beat, beat_of, enough, fitted, left_of
from wingfit.records import Dataset
from wingfit.records.array_types import Array

RECORDINGS = 64  # that are compared, at most
MISSED, SEEN = 0.75, 0.45  # of the forces of the recording, at least; and with coefficients of all recordings
OTHERS = 0.4  # of those of the others, at most: beyond, the model explains too little to compare
UNUSUAL = 2.5  # times that of the others, at least
LIKE, NEAR = 0.4, (1.5, 0.05)  # with the mistake undone, at most: of the forces; times that of the others, and more
ALIKE = 1.3, 0.01  # times what the best leaves, and more: what leaves less may be the cause as well
LEAST = 0.02  # of the forces: the quasi-steady model does not come nearer


@dataclass(frozen=True)
class _Undone:
    left: float
    rank: int
    kind: Kind
    cause: str
    edits: tuple[Edit, ...]


def check_single_forces(dataset: Dataset) -> Iterator[Mistake]:
    """Yield the likeliest mistake in each recording that has one of its own."""
    chosen = [(k, one) for k, one in enumerate(dataset.recordings) if enough(one)][:RECORDINGS]
    beats = [beat_of(dataset.vehicle, recording, index) for index, recording in chosen]
    while len(beats) > 1:
        together = fitted(beats)
        if max(left_of(beat, together) for beat in beats) < SEEN:
            return
        candidates = sorted((_missed(beats, beat) for beat in beats), key=lambda one: -one.missed / one.usual)
        tried = ((one.beat, one.undone(dataset)) for one in candidates)
        beat, found = next(((beat, found) for beat, found in tried if found is not None), (None, None))
        if found is None:
            return
        yield found
        beats = [one for one in beats if one is not beat]


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A recording, the ``coefficients`` of the others, and the part of the forces that they miss.

    Attributes:
        missed: of its own forces.
        usual: of those of the others, their median.
    """

    beat: Beat
    coefficients: Array
    missed: float
    usual: float

    def undone(self, dataset: Dataset) -> Mistake | None:
        """Return the mistake without which this recording is like the others, None if there is none."""
        if self.missed < max(MISSED, UNUSUAL * self.usual) or self.usual > OTHERS:
            return None
        most = min(LIKE, NEAR[0] * self.usual + NEAR[1])
        tried = [one for one in (*self._columns(), *self._pitches(dataset)) if one.left <= most]
        if not tried:
            return None
        least = min(one.left for one in tried)
        alike = [one for one in tried if one.left <= ALIKE[0] * least + ALIKE[1]]
        return self._mistake(sorted(alike, key=lambda one: (one.rank, one.left)))

    def _columns(self) -> Iterator[_Undone]:
        def left(one: ColumnMistake) -> float:
            return left_of(replace(self.beat, forces=one.undo(self.beat.forces)), self.coefficients)

        axes, shift = self.beat.recording.forces, best_shift(left)
        shifts = [shift] if abs(shift.beats) > LATE else []
        for one in (*column_mistakes(axes, both=len(axes) == 2), *shifts):
            yield _Undone(left(one), one.rank, one.kind, one.cause, (one.edit(self.beat.recording),))

    def _pitches(self, dataset: Dataset) -> Iterator[_Undone]:
        recording = self.beat.recording
        pitch = recording.condition.angle_of_attack
        for turned, cause in body_pitches(np.array([pitch])):
            new = float(turned[0])
            if abs(new) > np.pi / 2 * 1.01:
                continue
            changed = replace(recording, condition=replace(recording.condition, angle_of_attack=new))
            try:
                again = replace(beat_of(dataset.vehicle, changed, self.beat.index), forces=self.beat.forces)
            except (ValueError, ArithmeticError):
                continue
            edit = KeyEdit(
                ("recordings", self.beat.index, "body_pitch_deg"), f"{np.degrees(pitch):.6g}", f"{np.degrees(new):.6g}"
            )
            yield _Undone(left_of(again, self.coefficients), 0, "body pitch", cause, (edit,))

    def _mistake(self, alike: Sequence[_Undone]) -> Mistake:
        """Return the first of ``alike`` as a mistake; if there are others, there is no edit to make unasked."""
        first, *others = alike
        return Mistake(
            first.kind,
            f"recording {self.beat.recording.name!r}",
            f"a quasi-steady model with the coefficients of the other recordings misses {100 * self.missed:.0f} % of "
            f"the forces, and {100 * self.usual:.0f} % of theirs",
            f"{100 * first.left:.0f} %, as with the change",
            "; or ".join(one.cause for one in alike),
            "; or ".join(change_of(one.edits) for one in alike),
            False,
            () if others else first.edits,
            alone=True,
        )


def _missed(beats: Sequence[Beat], beat: Beat) -> _Candidate:
    others = [one for one in beats if one is not beat]
    coefficients = fitted(others)
    usual = float(np.median([left_of(one, coefficients) for one in others]))
    return _Candidate(beat, coefficients, left_of(beat, coefficients), max(usual, LEAST))
