"""Forces of a vehicle against a quasi-steady model of the described wings: axes, signs, unit, phase, motion, condition.

The forces of a blade-element model are sums of terms, each with a coefficient that every wing has within wide limits.
If no coefficients within these limits come near the recorded beat, and one of the usual mistakes, undone, lets them
come much nearer, the mistake is named. That is a warning, never a refusal: an experiment may have strong physics that
the model does not have. On the plants of the concealed trials, with such physics, the model leaves 0 to 60 % of the
forces.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from wingfit.checks.harmonics import fit
from wingfit.checks.mistake import EVERY, Edit, KeyEdit, Kind, Mistake, TableEdit, change_of
from wingfit.checks.motion import HYPOTHESES as MOTIONS
from wingfit.records import Dataset, Recording, Vehicle
from wingfit.records.array_types import Array
from wingfit.records.dataset import STANDARD_GRAVITY
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing

HARMONICS, ELEMENTS, INSTANTS = 6, 12, 200
RECORDINGS = 3  # that are compared
COEFFICIENTS = {"C_l": (0.15, 6.0), "C_r": (0.0, 10.0), "C_F": (0.0, 8.0), "C_D0": (0.0, 1.5), "C_Dpi2": (0.0, 8.0)}
LEFT = 0.75  # of the forces, residual of the model at least where a mistake is looked for
SUSPECT = 0.35  # from here on, if it then leaves next to nothing
EXPLAINED = 0.1  # residual with which no other mistake is looked for
BETTER, FAR_BETTER = 0.5, 0.2  # of that, the residual at most with the mistake undone
SHIFTS = 24  # parts of a beat that are tried
LATE = 2 / 24  # beats: smaller shifts are not remarked on
GRAM_FORCE = STANDARD_GRAVITY / 1000.0
UNITS = (
    (GRAM_FORCE, "gram-force"),
    (1e-3, "millinewtons"),
    (4.4482216, "pounds-force"),
    (STANDARD_GRAVITY, "kilograms"),
)
# Weights: distance of the mean force from the weight. Flights of the trials have 0.1 to 0.7, as models lack lift.
TRIMMED, UNTRIMMED, NEARER = 0.65, 0.9, 0.6


@dataclass(frozen=True, eq=False)
class _Beat:
    """Harmonics [2 K + 1, 2] of a recording along body x and z (N), NaN where an axis was not recorded; its rows."""

    recording: Recording
    index: int
    forces: Array
    fixed: Array
    rows: Array


def check_forces(dataset: Dataset) -> Iterator[Mistake]:
    """Yield the likeliest mistake in the forces of a vehicle, if there is one."""
    vehicle = dataset.vehicle
    chosen = list(enumerate(dataset.recordings))[:: max(1, len(dataset.recordings) // RECORDINGS)][:RECORDINGS]
    beats = [_beat(vehicle, recording, index) for index, recording in chosen if _enough(recording)]
    if not beats:
        return
    given = _left(beats)
    if given > SUSPECT:
        found = _rearranged(dataset, beats, given)
        if found is None or found[0] > EXPLAINED:
            # Exchanged columns may imitate a wrong motion; the motion itself then explains far more.
            other = _described(dataset, beats, given)
            found = other if other and (found is None or other[0] < 0.6 * found[0]) else found
        if found is not None:
            yield found[1]
            return
    yield from _trim(dataset)


def _enough_better(given: float) -> float:
    """Part of the forces that may be left with the mistake undone, if ``given`` is left with it."""
    return (BETTER if given > LEFT else FAR_BETTER) * given


def _enough(recording: Recording) -> bool:
    beats = recording.condition.flap_frequency * float(np.ptp(recording.times))
    return beats > 0.8 and len(recording.times) > 3 * (2 * HARMONICS + 1) and bool(np.isfinite(recording.values).any())


def _beat(vehicle: Vehicle, recording: Recording, index: int) -> _Beat:
    waves = fit(recording.times, recording.values, recording.condition.flap_frequency, HARMONICS)
    forces = np.full((2 * HARMONICS + 1, 2), np.nan)
    for column, axis in enumerate(recording.forces):
        wave = waves.waves[:, column]
        forces[:, "xz".index(axis)] = _stacked(waves.mean[column], wave)
    model = BladeElementWing(vehicle, elements=ELEMENTS, instants=INSTANTS)
    names = [gene.name for gene in model.genes]
    columns = [names.index(name) for name in COEFFICIENTS if name in names]
    base = np.array([gene.nominal for gene in model.genes])
    base[columns] = 0.0
    batch = np.vstack([base, *(base + np.eye(len(base))[column] for column in columns)])
    simulated = np.fft.rfft(model.beat(batch, recording), axis=1) / INSTANTS
    series = np.array(
        [[_stacked(one[0, k].real, 2 * one[1 : HARMONICS + 1, k]) for k in range(2)] for one in simulated]
    )
    series = series.transpose(0, 2, 1)
    return _Beat(recording, index, forces, series[0], series[1:] - series[0])


def _stacked(mean: float, waves: Array) -> Array:
    """One column [2 K + 1]: the mean, and real and imaginary parts of the harmonics over the root of two."""
    return np.concatenate([[mean], np.stack([waves.real, waves.imag], axis=1).ravel() / np.sqrt(2.0)])


def _left(beats: Sequence[_Beat], change: Callable[[Array], Array] = np.asarray) -> float:
    """Return the part of the forces, changed by ``change``, that no coefficients explain: median over recordings."""
    return float(np.median([_left_of(one, change(one.forces)) for one in beats]))


def _left_of(beat: _Beat, forces: Array) -> float:
    limits = [COEFFICIENTS[name] for name in COEFFICIENTS][: len(beat.rows)]
    if len(beat.rows) < len(COEFFICIENTS):  # without C_F
        limits = [bounds for name, bounds in COEFFICIENTS.items() if name != "C_F"][: len(beat.rows)]
    known = np.isfinite(forces)
    sizes = np.sqrt(np.nansum(forces**2, axis=0))
    # An axis that is a tenth of the other counts as a tenth: it may be noise.
    weights = (1.0 / np.maximum(np.where(sizes > 0, sizes, np.inf), 0.2 * np.nanmax(sizes)))[None, :]
    design = np.stack([(row * weights)[known] for row in beat.rows], axis=1)
    wanted = ((forces - beat.fixed) * weights)[known]
    low, high = (np.array(these, float) for these in zip(*limits, strict=True))
    found = lsq_linear(design, wanted, (low - 1e-12, high))
    total = float(np.nansum((forces * weights) ** 2))
    return float(np.sqrt(2.0 * found.cost / total)) if total > 0 else 0.0


def _rearranged(dataset: Dataset, beats: Sequence[_Beat], given: float) -> tuple[float, Mistake] | None:
    """Mistakes in the columns: axes, signs, unit, start of the beat. The simplest one that explains most."""
    tried: list[tuple[float, int, Mistake]] = []

    def one(
        rank: int,
        change: Callable[[Array], Array],
        kind: Kind,
        cause: str,
        columns: str,
        old: str,
        new: str,
        alter: Callable[..., tuple[Array, Array]],
    ) -> None:
        left = _left(beats, change)
        if left < _enough_better(given):
            edits = tuple(TableEdit(r.name, columns, old, new, alter) for r in dataset.recordings)
            tried.append((left, rank, _mistake(kind, given, left, cause, edits)))

    both = all(len(beat.recording.forces) == 2 for beat in beats)
    for signs in ((1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
        names = [f"force_{axis}_n" for axis, sign in zip("xz", signs, strict=True) if sign < 0]
        flip = np.array(signs)
        one(
            0 if len(names) == 1 else 1, _times(flip), "force axes",
            f"the sign of {' and '.join(names)}: x to the nose, z down, forces of the wings on the body",
            " and ".join(names), "F", "-F", _multiplied(dict(zip("xz", signs, strict=True))),
        )  # fmt: skip
    for signs in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)) if both else ():
        turn = np.array(signs)
        text = ", ".join(("-" if sign < 0 else "") + f"force_{axis}_n" for axis, sign in zip("zx", signs, strict=True))
        one(
            2, _times(turn, turned=True), "force axes", "the axes x and z are exchanged",
            "(force_x_n, force_z_n)", "(force_x_n, force_z_n)", f"({text})", _exchanged(turn),
        )  # fmt: skip
    for factor, unit in UNITS:
        one(
            1, _times(factor), "force unit", f"the forces are in {unit}",
            "columns force_*_n", unit, f"newtons (times {factor:.6g})", _multiplied({"x": factor, "z": factor}),
        )  # fmt: skip
    shift, left = _best_shift(beats)
    if abs(shift) > LATE and left < _enough_better(given):
        tried.append((left, 1, _late(dataset, given, left, shift)))
    if not tried:
        return None
    least = min(left for left, _, _ in tried)
    near = (one for one in tried if one[0] < 1.6 * least + 0.02)
    left, _, found = min(near, key=lambda one: (one[1], one[0]))
    return left, found


def _times(factor: Array | float, *, turned: bool = False) -> Callable[[Array], Array]:
    return lambda forces: np.asarray((forces[:, ::-1] if turned else forces) * factor)


def _late_by(beats: float) -> Callable[[Array], Array]:
    return lambda forces: _shifted(forces, beats)


def _best_shift(beats: Sequence[_Beat]) -> tuple[float, float]:
    lefts = [_left(beats, _late_by(u)) for u in np.arange(SHIFTS) / SHIFTS]
    best = int(np.argmin(lefts))
    return ((best + SHIFTS // 2) % SHIFTS - SHIFTS // 2) / SHIFTS, lefts[best]


def _shifted(forces: Array, beats: float) -> Array:
    """Harmonics [2 K + 1, 2] of forces whose time zero is later by ``beats``."""
    k = np.arange(1, HARMONICS + 1)[:, None]
    waves = (forces[1::2] + 1j * forces[2::2]) * np.exp(2j * np.pi * k * beats)
    out = forces.copy()
    out[1::2], out[2::2] = waves.real, waves.imag
    return out


def _late(dataset: Dataset, given: float, left: float, shift: float) -> Mistake:
    def later(recording: Recording) -> Callable[..., tuple[Array, Array]]:
        delay = shift / recording.condition.flap_frequency
        return lambda times, values, _: (times - delay, values)

    edits = tuple(
        TableEdit(r.name, "column time_s", "t", f"t - {shift / r.condition.flap_frequency:.5g} s", later(r))
        for r in dataset.recordings
    )
    cause = f"time zero is not where the wings are closest and begin to open, but {-shift:+.2g} beats off"
    return _mistake("force phase", given, left, cause, edits)


def _multiplied(factors: dict[str, float]) -> Callable[..., tuple[Array, Array]]:
    def alter(times: Array, values: Array, names: tuple[str, ...]) -> tuple[Array, Array]:
        return times, values * np.array([factors[name.rpartition("_")[2]] for name in names])

    return alter


def _exchanged(turn: Array) -> Callable[..., tuple[Array, Array]]:
    return lambda times, values, _: (times, values[:, ::-1] * turn)


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


def _described(dataset: Dataset, beats: Sequence[_Beat], given: float) -> tuple[float, Mistake] | None:
    """Mistakes in the description of motion and conditions, each undone in turn."""
    best: tuple[float, Mistake] | None = None
    for hypothesis in MOTIONS:
        changed = hypothesis.change(dataset)
        if changed is None:
            continue
        try:
            again = [_beat(changed.vehicle, changed.recordings[one.index], one.index) for one in beats]
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
    for new, cause in (
        (np.degrees(pitch), "the body pitch is in radians, in the key body_pitch_deg"),
        (np.pi / 2 - pitch, "the body pitch is measured from the vertical, not from level"),
        (-pitch, "the sign of the body pitch: positive nose up"),
    ):
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
