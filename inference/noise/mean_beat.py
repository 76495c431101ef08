"""The mean beat of a recording: a Fourier series in the phase of the beat, fitted to all beats of the recording."""

from __future__ import annotations

import numpy as np

from wingfit.records.array_types import Array, Bool, Float, Mask


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
    masks, group = np.unique(valid, axis=1, return_inverse=True)
    for k, mask in enumerate(masks.T):
        (columns,) = np.nonzero(group.ravel() == k)
        part, own = basis[mask], values[np.ix_(mask, columns)]
        out[np.ix_(mask, columns)] = own - part @ np.linalg.lstsq(part, own, rcond=None)[0]
    return out
