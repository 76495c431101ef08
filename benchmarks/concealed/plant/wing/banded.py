"""Cholesky factorisation of a symmetric band matrix; row i of its array [n, width] holds columns i - width + 1 to i."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.compiled import compiled

Array = npt.NDArray[np.float64]


@compiled
def factor(A: Array) -> None:
    """Replace the band matrix ``A`` [n, width] by its lower Cholesky factor L, with 1 / L_ii on the diagonal."""
    n, width = A.shape
    last = width - 1
    for i in range(n):
        row = A[i]
        for j in range(max(0, i - last), i):
            first = max(0, i - last, j - last)
            x, y = row[first - i + last : j - i + last], A[j, first - j + last : last]
            total = 0.0
            for k in range(len(x)):
                total += x[k] * y[k]
            row[j - i + last] = (row[j - i + last] - total) * A[j, last]
        total = 0.0
        for k in range(max(0, i - last) - i + last, last):
            total += row[k] * row[k]
        row[last] = 1.0 / math.sqrt(row[last] - total)


@compiled
def solve(L: Array, x: Array) -> None:
    """Replace the right-hand side ``x`` [n] by the solution y of A y = x; ``L``: A after :func:`factor`."""
    n, width = L.shape
    last = width - 1
    for i in range(n):
        first = max(0, i - last)
        row, part = L[i, first - i + last : last], x[first:i]
        total = 0.0
        for k in range(len(part)):
            total += row[k] * part[k]
        x[i] = (x[i] - total) * L[i, last]
    for i in range(n - 1, -1, -1):
        first = max(0, i - last)
        row, part = L[i, first - i + last : last], x[first:i]
        x[i] *= L[i, last]
        value = x[i]
        for k in range(len(part)):
            part[k] -= value * row[k]
