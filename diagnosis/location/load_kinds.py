"""Define the kinds of missing load on a wing, with priors: smooth loads, localised loads, errors of the drive."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from wingfit.records.array_types import Array, Float
from wingfit.sim.effects.probe import Probe

_LENGTHS = (0.25, 0.5)  # of the span: correlation lengths of smooth loads
_CENTRES = np.linspace(0.0, 1.0, 41)  # of localised loads along the span (0 to 1)
_WIDTHS = (0.07, 0.15, 0.3)  # their standard deviations
_CHORDS = np.linspace(0.0, 1.0, 9)  # their locations along the chord (0 to 1)
_LEVER = 0.25  # of the chord: standard deviation of the lever of smooth loads about mid-chord
_DECAYS = (0.0, 1.0, 2.0)  # exponents with which the standard deviation of loads falls with the harmonic
_SMOOTH = 0.1  # prior probability of smooth loads; localised loads have the rest
_DRIVE_ERROR = 0.1  # prior probability of an error of the drive
_RODS = (((1.0, 1.0),), ((1.0, 0.0),), ((0.0, 1.0),), ((1.0, 0.0), (0.0, 1.0)))  # both rods, one, or each independently


class LoadFamily(NamedTuple):
    """A family of kinds of load (forces and moments) along the span.

    Attributes:
        shapes: for each kind, Z shapes [Z, stations]; a load of this kind is their sum with independent random sizes.
        places: centre, width and chord location (0 to 1) of each kind; None where it has none.
        share: prior probability of each kind.
        drive_error: whether the columns of the shapes after the stations are rotations of the two rods, and no load
            acts.
    """

    shapes: tuple[Array, ...]
    places: tuple[tuple[float | None, float | None, float | None], ...]
    share: float
    drive_error: bool = False

    def __len__(self) -> int:
        return len(self.shapes)


class LoadForm(NamedTuple):
    """Kind ``number`` of a ``family``, with standard deviations ``spread`` [M] of the M Fourier terms of the beat."""

    family: LoadFamily
    number: int
    spread: Float[Array, " M"]

    @property
    def root(self) -> Float[Array, "P Q"]:
        """Square root [P, Q] of the prior covariance of the probe's P genes at strength 1; Q = Z M (Z shapes)."""
        return np.asarray(np.kron(self.family.shapes[self.number].T, np.diag(self.spread)), float)


def spreads(probe: Probe) -> list[Float[Array, " M"]]:
    """Return possible standard deviations [M] of the M Fourier terms of a load over the beat, relative to the mean."""
    order = np.arange(1, probe.harmonics + 1)
    return [np.concatenate([[1.0], np.tile(order**-decay, 2)]) for decay in _DECAYS]


def smooth(probe: Probe, chord: Float[Array, " J"] | None) -> LoadFamily:
    """Return loads correlated over a length of the span, moments independent of forces; ``chord`` [stations] in m."""
    y, shapes = np.array(probe.stations), []
    for length in _LENGTHS:
        root = np.linalg.cholesky(np.exp(-0.5 * ((y[:, None] - y) / length) ** 2) + 1e-9 * np.eye(len(y))).T
        if probe.turning and chord is not None:
            nothing = np.zeros_like(root)
            root = np.block([[root, nothing], [nothing, _LEVER * chord * root]])
        shapes.append(root)
    return LoadFamily(_without_rods(probe, shapes), ((None, None, None),) * len(shapes), _SMOOTH / len(shapes))


def localised(probe: Probe, chord: Float[Array, " J"] | None) -> LoadFamily:
    """Return Gaussian bumps of force along the span, with moments by chord location; ``chord`` [stations] in m."""
    span = np.linspace(0.0, 1.0, 401)
    hats, shapes = probe.hats(span), []
    places: list[tuple[float | None, float | None, float | None]] = []
    for centre, width in product(_CENTRES, _WIDTHS):
        bump = np.exp(-0.5 * ((span - centre) / width) ** 2)
        force = np.linalg.lstsq(hats, bump, rcond=None)[0]
        if not probe.turning or chord is None:
            shapes.append(force[None])
            places.append((float(centre), width, None))
            continue
        for part in _CHORDS:
            shapes.append(np.concatenate([force, (0.5 - part) * chord * force])[None])
            places.append((float(centre), width, float(part)))
    rest = 1.0 - _SMOOTH - (_DRIVE_ERROR if probe.driving else 0.0)
    return LoadFamily(_without_rods(probe, shapes), tuple(places), rest / len(shapes))


def drive_errors(probe: Probe) -> LoadFamily:
    """Return errors of the drive rods; empty for a probe that does not rotate the rods."""
    if not probe.driving:
        return LoadFamily((), (), 0.0, drive_error=True)
    still = np.zeros((2, probe.loads // (1 + 2 * probe.harmonics)))
    shapes = tuple(np.hstack([still[: len(rods)], np.array(rods)]) for rods in _RODS)
    return LoadFamily(shapes, ((None, None, None),) * len(shapes), _DRIVE_ERROR / len(shapes), drive_error=True)


def _without_rods(probe: Probe, shapes: Sequence[Array]) -> tuple[Array, ...]:
    """Return ``shapes`` of loads with columns of zeros appended for the rods, if the probe rotates these."""
    return tuple(np.pad(shape, ((0, 0), (0, 2 * probe.driving))) for shape in shapes)
