"""Beam theory, the rigid-body chain that approximates a beam, and the cases that ``benchmarks.beams`` measures."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from benchmarks.beams import (
    CASES,
    ELASTIC,
    STOCKY,
    THICK_PLATE,
    UNIFORM_ROD,
    UNIFORM_SHEET,
    WINGS,
    frequency_errors,
    frequency_markdown,
    observed_order,
    torsion_carried,
    twist_rate,
    wing_tracks,
)
from benchmarks.physics.beam_theory import (
    CANTILEVER_ROOTS,
    Array,
    Beam,
    Family,
    elastica,
    euler_bernoulli,
    timoshenko,
    torsion_constant,
    torsional,
)
from benchmarks.physics.spring_chain import cut_beam, spring_chain

__all__ = [
    "CANTILEVER_ROOTS",
    "CASES",
    "ELASTIC",
    "STOCKY",
    "THICK_PLATE",
    "UNIFORM_ROD",
    "UNIFORM_SHEET",
    "WINGS",
    "Beam",
    "Family",
    "cut_beam",
    "elastica",
    "euler_bernoulli",
    "frequency_errors",
    "frequency_markdown",
    "observed_order",
    "spring_chain",
    "timoshenko",
    "torsion_carried",
    "torsion_constant",
    "torsional",
    "transfer_matrix",
    "twist_rate",
    "wing_tracks",
]


def transfer_matrix(rate: Array, length: float) -> Array:
    """[4, 4] from the state at the root of a uniform beam to that at its tip; d state / dy = ``rate`` @ state."""
    return np.asarray(expm(rate * length))
