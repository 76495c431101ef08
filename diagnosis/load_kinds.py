"""Kinds of load that a wing may bear which its model does not know: smooth ones, and those of one place."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sim.effects.probe import Probe

Array = npt.NDArray[np.float64]

_LENGTHS = (0.25, 0.5)  # of the span, over which smooth loads are alike
_CENTRES = np.linspace(0.0, 1.0, 41)  # of loads of one place, parts of the span
_WIDTHS = (0.07, 0.15, 0.3)  # their standard deviation
_CHORDS = np.linspace(0.0, 1.0, 9)  # where along the chord they may act, parts of it
_TURNING = 0.25  # of the chord: standard deviation of the lever of smooth loads about its middle
_DECAYS = (0.0, 1.0, 2.0)  # powers of the harmonic by which the standard deviation of loads falls
_SMOOTH = 0.1  # probability a priori of smooth loads; that of loads of one place is the rest


class Family(NamedTuple):
    """Shapes [K, Z, stations] of loads, forces and moments; ``places``: centre, width and chord of each, if any.

    ``share``: probability a priori of each of them.
    """

    shapes: Array
    places: tuple[tuple[float | None, float | None, float | None], ...]
    share: float

    def __len__(self) -> int:
        return len(self.shapes)


class Form(NamedTuple):
    """One shape of a family, with a spread [M] over the terms of the beat."""

    family: Family
    number: int
    spread: Array

    @property
    def root(self) -> Array:
        """[P, Z M] of the covariance of loads at strength one."""
        return np.asarray(np.kron(self.family.shapes[self.number].T, np.diag(self.spread)), float)


def spreads(probe: Probe) -> list[Array]:
    """Standard deviations [M] of the terms of a load over the beat, several possible ones."""
    order = np.arange(1, probe.harmonics + 1)
    return [np.concatenate([[1.0], np.tile(order**-decay, 2)]) for decay in _DECAYS]


def smooth(probe: Probe, chord: Array | None) -> Family:
    """Loads that are alike over a length of the span, forces and moments by themselves."""
    y, shapes = np.array(probe.stations), []
    for length in _LENGTHS:
        root = np.linalg.cholesky(np.exp(-0.5 * ((y[:, None] - y) / length) ** 2) + 1e-9 * np.eye(len(y))).T
        if probe.turning and chord is not None:
            nothing = np.zeros_like(root)
            root = np.block([[root, nothing], [nothing, _TURNING * chord * root]])
        shapes.append(root)
    return Family(np.array(shapes), ((None, None, None),) * len(shapes), _SMOOTH / len(shapes))


def placed(probe: Probe, chord: Array | None) -> Family:
    """Loads of one place: forces as of bumps along the span, and moments about the span as their chord says."""
    span = np.linspace(0.0, 1.0, 401)
    hats, shapes = probe.hats(span), []
    places: list[tuple[float | None, float | None, float | None]] = []
    for centre, width in product(_CENTRES, _WIDTHS):
        bump = np.exp(-0.5 * ((span - centre) / width) ** 2)
        force = np.linalg.lstsq(hats, bump, rcond=None)[0]
        if not probe.turning or chord is None:
            shapes.append(force)
            places.append((float(centre), width, None))
            continue
        for part in _CHORDS:
            shapes.append(np.concatenate([force, (0.5 - part) * chord * force]))
            places.append((float(centre), width, float(part)))
    return Family(np.array(shapes)[:, None, :], tuple(places), (1.0 - _SMOOTH) / len(shapes))
