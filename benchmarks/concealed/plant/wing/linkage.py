"""The drive: angles of the driving rods over a turn of the motor, from a four-bar linkage or a Fourier series."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wingfit.records import Drive, FourBarDrive

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

_TURN = 1024  # instants of a turn
HARMONICS = 40


def rocker(link: FourBarDrive, psi: Array) -> Array:
    """Angle [n] (rad) of a four-bar linkage's rocker at crank angles ``psi`` [n] (rad), continuous over a turn.

    Freudenstein's equation (1955): a cos(theta) + b sin(theta) = k, solved by the tangent of theta / 2. Of the two
    assemblies it is the one whose rocker lies clockwise of the line from its pivot to the crank pin. ValueError without
    a full turn.
    """
    a, b = link.crank * np.cos(psi) - link.ground, link.crank * np.sin(psi)
    k = (link.rocker**2 - link.coupler**2 + a**2 + b**2) / (2 * link.rocker)
    square = a**2 + b**2 - k**2
    if np.any(square < 0):
        raise ValueError(
            f"linkage of ground {link.ground:g}, crank {link.crank:g}, coupler {link.coupler:g} and rocker "
            f"{link.rocker:g} m cannot make a full turn; shorten the crank"
        )
    theta = np.unwrap(2 * np.arctan2(b - np.sqrt(square), a + k)) + link.offset
    return np.asarray(theta - 2 * np.pi * np.round(theta.mean() / (2 * np.pi)))


def series_of(drive: Drive) -> Complex:
    """Complex Fourier series [HARMONICS + 1] of the driving rod's angle (rad) over the drive phase psi.

    angle = Re sum_k series_k exp(i k psi).
    """
    found = np.zeros(HARMONICS + 1, np.complex128)
    if isinstance(drive, FourBarDrive):
        angle = rocker(drive, 2 * np.pi * np.arange(_TURN) / _TURN)
        found[:] = 2 * np.fft.rfft(angle)[: HARMONICS + 1] / _TURN
        found[0] *= 0.5
        return found
    found[0] = drive.mean
    found[1 : 1 + len(drive.cosine)] += drive.cosine
    found[1 : 1 + len(drive.sine)] -= 1j * np.array(drive.sine)
    return found


def angles(series: Complex, psi: Array) -> Array:
    """[..., 2]: angle (rad) of Fourier ``series`` and its derivative by the drive phase, at ``psi`` [...] (rad)."""
    k = np.arange(len(series))
    turn = np.exp(1j * psi[..., None] * k)
    return np.stack([(turn @ series).real, (turn @ (1j * k * series)).real], axis=-1)
