"""A quasi-steady model of the described wings, and the part of recorded forces that it cannot explain.

The forces of a blade-element model are sums of terms, each with a coefficient that every wing has within wide limits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from wingfit.checks.harmonics import fit
from wingfit.records import Recording, Vehicle
from wingfit.records.array_types import Array
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing

HARMONICS, ELEMENTS, INSTANTS = 6, 12, 200
COEFFICIENTS = {"C_l": (0.15, 6.0), "C_r": (0.0, 10.0), "C_F": (0.0, 8.0), "C_D0": (0.0, 1.5), "C_Dpi2": (0.0, 8.0)}


@dataclass(frozen=True, eq=False)
class Beat:
    """A recording as harmonics.

    Attributes:
        recording, index: the recording, and its number in the dataset.
        forces: [2 K + 1, 2] (N) along body x and z; NaN where an axis was not recorded.
        fixed: the same, of the model with coefficients of zero.
        rows: [coefficients, 2 K + 1, 2], what a coefficient of one adds.
        names: of the coefficients.
    """

    recording: Recording
    index: int
    forces: Array
    fixed: Array
    rows: Array
    names: tuple[str, ...]


def enough(recording: Recording) -> bool:
    """Return whether ``recording`` has most of a beat, with samples enough for the harmonics."""
    beats = recording.condition.flap_frequency * float(np.ptp(recording.times))
    return beats > 0.8 and len(recording.times) > 3 * (2 * HARMONICS + 1) and bool(np.isfinite(recording.values).any())


def beat_of(vehicle: Vehicle, recording: Recording, index: int) -> Beat:
    """Return the harmonics of ``recording``, which has the number ``index``, and of the model under its condition."""
    waves = fit(recording.times, recording.values, recording.condition.flap_frequency, HARMONICS)
    forces = np.full((2 * HARMONICS + 1, 2), np.nan)
    for column, axis in enumerate(recording.forces):
        wave = waves.waves[:, column]
        forces[:, "xz".index(axis)] = _stacked(waves.mean[column], wave)
    model = BladeElementWing(vehicle, elements=ELEMENTS, instants=INSTANTS)
    genes = [gene.name for gene in model.genes]
    names = tuple(name for name in COEFFICIENTS if name in genes)
    base = np.array([gene.nominal for gene in model.genes])
    columns = [genes.index(name) for name in names]
    base[columns] = 0.0
    batch = np.vstack([base, *(base + np.eye(len(base))[column] for column in columns)])
    simulated = np.fft.rfft(model.beat(batch, recording), axis=1) / INSTANTS
    series = np.array(
        [[_stacked(one[0, k].real, 2 * one[1 : HARMONICS + 1, k]) for k in range(2)] for one in simulated]
    )
    series = series.transpose(0, 2, 1)
    return Beat(recording, index, forces, series[0], series[1:] - series[0], names)


def fitted(beats: Sequence[Beat]) -> Array:
    """Return the coefficients, within their limits, that explain most of the forces of ``beats``, all alike in size."""
    designs, wanted = [], []
    for beat in beats:
        known, weights = _weights(beat.forces)
        total = np.sqrt(np.nansum((beat.forces * weights) ** 2)) or 1.0
        designs.append(np.stack([(row * weights)[known] for row in beat.rows], axis=1) / total)
        wanted.append(((beat.forces - beat.fixed) * weights)[known] / total)
    low, high = (np.array(these, float) for these in zip(*(COEFFICIENTS[n] for n in beats[0].names), strict=True))
    return np.asarray(lsq_linear(np.concatenate(designs), np.concatenate(wanted), (low - 1e-12, high)).x)


def left_of(beat: Beat, coefficients: Array) -> float:
    """Return the part of the forces of ``beat`` that the model with these ``coefficients`` does not explain."""
    known, weights = _weights(beat.forces)
    total = float(np.nansum((beat.forces * weights) ** 2))
    missed = (beat.forces - beat.fixed - np.tensordot(coefficients, beat.rows, 1)) * weights
    return float(np.sqrt(np.sum(missed[known] ** 2) / total)) if total > 0 else 0.0


def _weights(forces: Array) -> tuple[Array, Array]:
    """Return which samples are known, and their weights [1, 2]: a small axis, which may be noise, counts little."""
    sizes = np.sqrt(np.nansum(forces**2, axis=0))
    return np.isfinite(forces), (1.0 / np.maximum(np.where(sizes > 0, sizes, np.inf), 0.2 * np.nanmax(sizes)))[None, :]


def _stacked(mean: float, waves: Array) -> Array:
    """One column [2 K + 1]: the mean, and real and imaginary parts of the harmonics over the root of two."""
    return np.concatenate([[mean], np.stack([waves.real, waves.imag], axis=1).ravel() / np.sqrt(2.0)])
