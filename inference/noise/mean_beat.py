"""The mean beat: a Fourier series in the phase of the beat, fitted to all beats of a recording."""

from __future__ import annotations

import numpy as np

from wingfit.records.array_types import Array, Bool, Float, Mask


def fourier_basis(psi: Float[Array, " T"], harmonics: int) -> Float[Array, "T P"]:
    """Columns 1, cos k psi, sin k psi for k = 1 .. H at phases [T]: [T, 1 + 2 H]."""
    angles = psi[:, None] * np.arange(1, harmonics + 1)
    return np.hstack([np.ones((len(psi), 1)), np.cos(angles), np.sin(angles)])


def scatter_about(
    basis: Float[Array, "T P"], values: Float[Array, "T C"], valid: Bool[Mask, "T C"]
) -> Float[Array, "T C"]:
    """``values`` [T, C] minus their least-squares fit by ``basis`` [T, P] over the ``valid`` samples, zero elsewhere.

    A channel with fewer valid samples than columns has no scatter.
    """
    out = np.zeros_like(values)
    masks, group = np.unique(valid, axis=1, return_inverse=True)
    for k, mask in enumerate(masks.T):
        (columns,) = np.nonzero(group.ravel() == k)
        part, own = basis[mask], values[np.ix_(mask, columns)]
        out[np.ix_(mask, columns)] = own - part @ np.linalg.lstsq(part, own, rcond=None)[0]
    return out
