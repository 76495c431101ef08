"""The mean beat of a recording: a Fourier series in the phase of the beat, fitted to all beats of the recording."""

from __future__ import annotations

import numpy as np

from wingfit.records.array_types import Array, Bool, Float, Index, Mask


def fourier_basis(psi: Float[Array, " T"], harmonics: int) -> Float[Array, "T P"]:
    """Return 1, then cos k psi, then sin k psi (k = 1 .. H) at the phases ``psi`` [T] (rad) as columns [T, 1 + 2 H].

    H is ``harmonics``.
    """
    angles = psi[:, None] * np.arange(1, harmonics + 1)
    return np.hstack([np.ones((len(psi), 1)), np.cos(angles), np.sin(angles)])


def scatter_about(
    basis: Float[Array, "T P"], values: Float[Array, "T C"], valid: Bool[Mask, "T C"]
) -> Float[Array, "T C"]:
    """Subtract from ``values`` [T, C] (T samples, C channels) their least-squares fit by the columns of a basis.

    ``basis`` [T, P]. Only ``valid`` samples are fitted; the result [T, C] is zero at the others. It is also zero (to
    round-off) for a channel with at most P valid samples, which the fit reproduces exactly.
    """
    out = np.zeros_like(values)
    for mask, columns in masks_of(valid):
        part, own = basis[mask], values[np.ix_(mask, columns)]
        out[np.ix_(mask, columns)] = own - part @ np.linalg.lstsq(part, own, rcond=None)[0]
    return out


def masks_of(valid: Bool[Mask, "T C"]) -> list[tuple[Mask, Index]]:
    """Return the different columns [T] of ``valid`` [T, C], each with the numbers of the channels that have it.

    In the order of the columns' values, False first. (`numpy.unique` takes time that grows with the square of T.)
    """
    found: dict[bytes, list[int]] = {}
    for channel, column in enumerate(valid.T):
        found.setdefault(column.tobytes(), []).append(channel)
    return [(valid[:, channels[0]], np.array(channels)) for _, channels in sorted(found.items())]
