"""Usual mistakes in the columns of forces: signs, exchanged axes, units, start of the beat; and what undoes each."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass

import numpy as np

from wingfit.checks.mistake import Alter, Kind, TableEdit
from wingfit.checks.quasi_steady import HARMONICS
from wingfit.records import Recording
from wingfit.records.array_types import Array
from wingfit.records.dataset import STANDARD_GRAVITY, ForceAxis

SHIFTS = 24  # parts of a beat that are tried
LATE = 2 / 24  # beats: smaller shifts are not remarked on
GRAM_FORCE = STANDARD_GRAVITY / 1000.0
UNITS = (
    (GRAM_FORCE, "gram-force"),
    (1e-3, "millinewtons"),
    (4.4482216, "pounds-force"),
    (STANDARD_GRAVITY, "kilograms"),
)


@dataclass(frozen=True)
class ColumnMistake:
    """A mistake in the columns, and its undoing.

    Attributes:
        rank: of several that explain about as much, the one with the lowest rank is the likeliest.
        kind, cause: as of a :class:`~wingfit.checks.mistake.Mistake`.
        undo: the harmonics [2 K + 1, 2] without the mistake.
        edit: the change of the table of a recording.
        beats: by which the beat is shifted, if it is.
    """

    rank: int
    kind: Kind
    cause: str
    undo: Callable[[Array], Array]
    edit: Callable[[Recording], TableEdit]
    beats: float = 0.0


def column_mistakes(axes: Collection[ForceAxis], *, both: bool) -> Iterator[ColumnMistake]:
    """Yield all but a shifted beat.

    ``axes``: which were recorded; ``both``: whether every recording has both of them, so that they can be exchanged.
    """
    for signs in ((1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
        if all(axis in axes for axis, sign in zip("xz", signs, strict=True) if sign < 0):
            yield _signs(signs)
    for turn in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)) if both else ():
        yield _exchange(turn)
    for factor, unit in UNITS:
        undone = f"newtons (times {factor:.6g})"
        edit = _edit("columns force_*_n", unit, undone, _multiplied({"x": factor, "z": factor}))
        yield ColumnMistake(1, "force unit", f"the forces are in {unit}", _times(factor), edit)


def late(shift: float) -> ColumnMistake:
    """Return the mistake that time zero is early by ``shift`` (beats)."""
    cause = f"time zero is not where the wings are closest and begin to open, but {-shift:+.2g} beats off"

    def edit(recording: Recording) -> TableEdit:
        delay = shift / recording.condition.flap_frequency
        return TableEdit(
            recording.name, "column time_s", "t", f"t - {delay:.5g} s", lambda times, values, _: (times - delay, values)
        )

    return ColumnMistake(1, "force phase", cause, lambda forces: _shifted(forces, shift), edit, shift)


def best_shift(left: Callable[[ColumnMistake], float]) -> ColumnMistake:
    """Return the shifted beat, among all parts of a beat, without which the least is ``left``."""
    every = [late(((k + SHIFTS // 2) % SHIFTS - SHIFTS // 2) / SHIFTS) for k in range(SHIFTS)]
    return min(every, key=left)


def _signs(signs: tuple[float, float]) -> ColumnMistake:
    names = [f"force_{axis}_n" for axis, sign in zip("xz", signs, strict=True) if sign < 0]
    columns = " and ".join(names)
    return ColumnMistake(
        0 if len(names) == 1 else 1,
        "force axes",
        f"the sign of {columns}: x to the nose, z down, forces of the wings on the body",
        _times(np.array(signs)),
        _edit(columns, "F", "-F", _multiplied(dict(zip("xz", signs, strict=True)))),
    )


def _exchange(turn: tuple[float, float]) -> ColumnMistake:
    text = ", ".join(("-" if sign < 0 else "") + f"force_{axis}_n" for axis, sign in zip("zx", turn, strict=True))
    return ColumnMistake(
        2,
        "force axes",
        "the axes x and z are exchanged",
        _times(np.array(turn), turned=True),
        _edit("(force_x_n, force_z_n)", "(force_x_n, force_z_n)", f"({text})", _exchanged(np.array(turn))),
    )


def _edit(columns: str, old: str, new: str, alter: Alter) -> Callable[[Recording], TableEdit]:
    return lambda recording: TableEdit(recording.name, columns, old, new, alter)


def _times(factor: Array | float, *, turned: bool = False) -> Callable[[Array], Array]:
    return lambda forces: np.asarray((forces[:, ::-1] if turned else forces) * factor)


def _shifted(forces: Array, beats: float) -> Array:
    """Harmonics [2 K + 1, 2] of forces whose time zero is later by ``beats``."""
    k = np.arange(1, HARMONICS + 1)[:, None]
    waves = (forces[1::2] + 1j * forces[2::2]) * np.exp(2j * np.pi * k * beats)
    out = forces.copy()
    out[1::2], out[2::2] = waves.real, waves.imag
    return out


def _multiplied(factors: dict[str, float]) -> Alter:
    def alter(times: Array, values: Array, names: tuple[str, ...]) -> tuple[Array, Array]:
        return times, values * np.array([factors[name.rpartition("_")[2]] for name in names])

    return alter


def _exchanged(turn: Array) -> Alter:
    return lambda times, values, _: (times, values[:, ::-1] * turn)
