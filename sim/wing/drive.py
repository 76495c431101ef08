"""Flap angle of the two driving rods over the beat, with its derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from wingfit.records import Drive, FourBarDrive, FourierDrive
from wingfit.records.array_types import Array, ArrayLike, Complex

_SAMPLES = 512
_HARMONICS = 40


@dataclass
class RodDrive:
    """Flap angles of the front and the rear rod for W individuals, as Fourier series of the drive phase psi.

    ``series`` [K + 1, 2, W] (harmonics, rods, individuals): angle = Re sum_k series_k exp(i k psi) in rad, where the
    series of the rear rod includes its lag.
    """

    series: Complex

    @classmethod
    def of(cls, drive: Drive, lag: float, lanes: int) -> RodDrive:
        """Make the angles for ``lanes`` individuals, all with the same ``drive`` and ``lag`` (rad) of the rear rod."""
        series = drive.series if isinstance(drive, FourierDrive) else _four_bar_series(drive)
        both = np.stack([series, series * np.exp(-1j * lag * np.arange(len(series)))], axis=1)
        return cls(np.repeat(both[:, :, None], lanes, axis=2))

    def lengthened(self, harmonics: int) -> None:
        """Extend the series in place, by zeros, to at least ``harmonics`` harmonics."""
        added = max(harmonics + 1 - len(self.series), 0)
        self.series = np.concatenate([self.series, np.zeros((added, *self.series.shape[1:]))])

    def angles(self, psi: Array) -> Array:
        """Return the angles [..., 2, 5, W] at the drive phases ``psi`` [...] (rad).

        The last axes are the rod (front, rear), the order of the derivative by the phase (0 to 4; angle in rad), and
        the individual. Each distinct series is evaluated separately, so that results do not depend on the other
        individuals.
        """
        phases = np.asarray(psi, float).tobytes()
        lanes = [self.series[:, :, w].tobytes() for w in range(self.series.shape[2])]
        found = {series: _angles(phases, series).reshape(*psi.shape, 2, 5) for series in dict.fromkeys(lanes)}
        return np.stack([found[series] for series in lanes], axis=-1)


@lru_cache(maxsize=64)
def _angles(phases: bytes, both: bytes) -> Array:
    """Angle and its first four derivatives by phase [T, 2, 5] of front and rear rod at T phases.

    ``phases``: bytes of the phases [T] (rad), ``both``: bytes of the series [K + 1, 2]; bytes can be keys of the cache.
    """
    series = np.frombuffer(both, np.complex128).reshape(-1, 2)
    turn = _turns(phases, len(series))
    order = (1j * np.arange(len(series))) ** np.arange(5)[:, None]
    derived = (series[:, :, None] * order.T[:, None]).reshape(len(series), -1)
    # not matrix products, for which starting the threads takes longer than the sums
    found = np.einsum("tk,kc->tc", turn.real, derived.real) - np.einsum("tk,kc->tc", turn.imag, derived.imag)
    angles = np.asarray(found.reshape(len(turn), 2, 5))
    angles.setflags(write=False)
    return angles


@lru_cache(maxsize=4)
def _turns(phases: bytes, terms: int) -> Complex:
    """exp(i k psi) [T, terms], k = 0, 1, ..., at T phases psi (rad), given as the bytes of their array."""
    return np.asarray(np.exp(1j * np.arange(terms) * np.frombuffer(phases)[:, None]))


def flap_angle(drive: Drive, psi: ArrayLike) -> Array:
    """Angle of the front rod (rad) and its first three derivatives by the drive phase, [..., 4].

    ``psi`` [...]: drive phases, rad.
    """
    series = RodDrive.of(drive, 0.0, 1).series[:, 0, 0]
    order = 1j * np.arange(len(series))
    wave = series * np.exp(order * np.asarray(psi, float)[..., None])
    return np.stack([(order**d * wave).sum(axis=-1).real for d in range(4)], axis=-1)


def four_bar_angle(linkage: FourBarDrive, psi: ArrayLike) -> Array:
    """Rocker angle (rad, the offset of the linkage included) at crank angles ``psi`` (rad).

    The crank turns about the origin, the rocker about (ground, 0). The tip of the rocker is where the circle of the
    coupler about the crank pin meets that of the rocker about its pivot; of the two intersections, that of the open
    linkage. ValueError if the linkage cannot turn a full revolution.
    """
    phase = np.asarray(psi, float)
    px, py = linkage.crank * np.cos(phase), linkage.crank * np.sin(phase)
    dx, dy = px - linkage.ground, py
    diagonal2 = dx**2 + dy**2
    along = np.mod(np.arctan2(dy, dx), 2 * np.pi)  # continuous, since the crank stays on one side of the rocker's pivot
    cosine = (linkage.rocker**2 + diagonal2 - linkage.coupler**2) / (2 * linkage.rocker * np.sqrt(diagonal2))
    if np.any(np.abs(cosine) > 1):
        raise ValueError(
            f"four-bar linkage with ground {linkage.ground:g}, crank {linkage.crank:g}, coupler {linkage.coupler:g}, "
            f"rocker {linkage.rocker:g} m cannot turn a full revolution; shorten the crank"
        )
    return np.asarray(along - np.arccos(cosine) + linkage.offset)


@lru_cache(maxsize=64)
def _four_bar_series(linkage: FourBarDrive) -> Complex:
    """Fourier series [K + 1] of the rocker angle over the crank angle: angle = Re sum_k series_k exp(i k psi), rad.

    It is exact to round-off for usual linkages, whose coefficients decrease fast.
    """
    psi = 2 * np.pi * np.arange(_SAMPLES) / _SAMPLES
    series = np.fft.rfft(four_bar_angle(linkage, psi))[: _HARMONICS + 1] / _SAMPLES
    series[0] = series[0].real
    series[1:] *= 2
    return np.asarray(series)
