"""Odd and even beats that differ: found against the noise, and kept apart from it.

A motion or force that repeats only every two beats has spectral lines half-way between the harmonics, at 1/2, 3/2, 5/2
of the flap frequency. Its power there is compared with that of the nearest lines, as the power of a slow change is
(:mod:`wingfit.inference.noise.changes.drift`). Beats that scatter in size alternate by chance, in all lines and
channels at once: so few beats show an alternation only if it is far above the scatter. A single line, such as the hum
of the mains at 5/2 of the flap frequency, is no beat that alternates: the change must be seen without the strongest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wingfit.inference.noise.changes.change_powers import ChangePowers, compared, envelopes
from wingfit.inference.noise.changes.drift import slow_basis
from wingfit.inference.noise.changes.slow_change import Change, orthonormal
from wingfit.inference.noise.mean_beat import fourier_basis, masks_of
from wingfit.records.array_types import Array, Bool, Float, Mask

LINES = 3  # half-way between harmonics: those near the harmonics in which a wing moves most
FEWEST_BEATS = 4  # with which lines of noise lie between a harmonic and the middle
NEAREST = 6  # spectral lines on either side with which the power is compared
FARTHEST = 0.3  # distance of these (flap frequencies): farther ones are near a harmonic, where a drift has its power
CERTAIN = 1e-4  # probability of noise alone below which odd and even beats count as different
BY_SIZE = 1e-2  # the same for beats that scatter in size
HARMONICS = {"tracks": 12, "forces": 24}  # of a steady beat that may appear at a line
APART = 1.5  # spectral lines between a line and such a harmonic, at least


def half_orders(kind: str, harmonics: int, step: float, samples: int) -> tuple[float, ...]:
    """Return the orders (flap frequencies) of the first lines half-way between harmonics without a steady beat.

    ``kind``: of the recording; ``step``: beats between two samples; ``samples``: from the first to the last. Under a
    strobe, or with few samples in a beat, higher harmonics may appear at such a line; then it is not used.
    """
    every = np.arange(1, HARMONICS[kind] + 1) * step
    return tuple(
        order
        for order in (k + 0.5 for k in range(min(LINES, harmonics)))
        if np.min(np.abs(_folded(every) - _folded(order * step))) > APART / samples
    )


def alternation_of(
    scatter: Float[Array, "T C"],
    valid: Bool[Mask, "T C"],
    psi: Float[Array, " T"],
    apparent: Float[Array, " T"],
    harmonics: int,
    beats: int,
    orders: tuple[float, ...],
    least: float = 0.0,
) -> Change | None:
    """Compare the difference of odd and even beats with the noise near its lines.

    ``orders``: of the lines (:func:`half_orders`); the other arguments are those of ``drift_of``. None with too few
    beats, fewer than two lines, or too few samples between gaps.
    """
    if beats < FEWEST_BEATS or len(orders) < 2:
        return None
    distances = np.arange(1, min(NEAREST, int(FARTHEST * beats)) + 1) / beats
    slow, _ = slow_basis(psi, apparent, beats, harmonics)
    parts = []
    for mask, channels in masks_of(valid):
        if not mask.any():
            continue
        known = orthonormal(np.hstack([fourier_basis(psi[mask], harmonics), slow[mask]]))
        lines = [orthonormal(_line(psi[mask], k), known) for k in orders]
        every = orthonormal(np.hstack(lines))
        around = [orthonormal(envelopes(psi[mask], apparent[mask], k, distances), known, every) for k in orders]
        values = scatter[np.ix_(mask, channels)]
        values = values - known @ (known.T @ values)
        steady = values - every @ (every.T @ values)
        parts.append(ChangePowers.of(values, steady, [lines], around, every[:, :0]))
    if not parts or min(float(one.freedom.min()) for one in parts) < 1.0:
        return None
    samples = int(valid.sum())
    found, rest = compared(parts, samples), compared(_without_strongest(parts), samples)
    by_size = compared(parts, samples, sources=1.0).probability * CERTAIN / BY_SIZE
    probability = max(found.probability, rest.probability, by_size) if found.size >= least else 1.0
    return replace(found, probability=probability, certain=CERTAIN)


def alternation_basis(psi: Float[Array, " T"], orders: tuple[float, ...]) -> Float[Array, "T P"]:
    """Return the waves of odd and even beats that differ, as columns [T, P]; ``psi`` [T]: phase (rad) of the beat."""
    return np.hstack([_line(psi, k) for k in orders])


def apparent_lines(orders: tuple[float, ...], step: float, advance: float) -> Float[Array, " L"]:
    """Return where the lines of these ``orders`` appear, in apparent flap frequencies.

    ``step`` and ``advance``: beats, and apparent beats, from sample to sample.
    """
    return _folded(np.array(orders) * step) / advance


def alternation_words(found: Sequence[tuple[str, str]]) -> str:
    """Return a remark on recordings in which odd and even beats differ: the name of each, and by how much."""
    where = ", ".join(f"{name} ({size})" for name, size in found)
    return (
        f"odd and even beats differ in {where}: motion or force repeats only every two beats (a flap frequency that is "
        "stated twice too high, play in the drive, a vibration at half the frequency), which a model with one beat "
        "does not explain; check the stated frequency and the drive"
    )


def _folded(cycles: npt.ArrayLike) -> Array:
    """Frequency, in cycles a sample, at which ``cycles`` a sample appear: 0 to 1/2."""
    every = np.asarray(cycles, float)
    return np.asarray(np.abs(every - np.round(every)))


def _line(psi: Array, order: float) -> Array:
    return np.column_stack([np.cos(order * psi), np.sin(order * psi)])


def _without_strongest(parts: list[ChangePowers]) -> list[ChangePowers]:
    power = sum((one.change[0] / one.level).sum(axis=-1) for one in parts)
    strongest = int(np.argmax(power))
    return [one.of_harmonics([k for k in range(len(one.near)) if k != strongest]) for one in parts]
