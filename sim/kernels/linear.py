"""The block-sparse linear system of a step: S = M / (h gamma) + sum of J^T (D + h gamma K) J over the connectors.

S is symmetric positive definite for every genome, so it is factored as L L^T without pivoting. ``blocks`` [NB, 36, W]
holds the 6 x 6 blocks: first the N diagonal ones, then those below the diagonal (``row`` > ``column``) including fill.
The symbolic factorisation (``sim.structure``) lists, in order, which blocks to scale and which products to subtract.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from sim.kernels import LANES
from sim.kernels.jit import kernel

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


@kernel
def start_blocks(mass: Array, inertia: Array, factor: float, damping: Array, blocks: Array) -> None:
    """Set the blocks to the inertia times ``factor`` plus ``damping`` [N, W] along each body's normal."""
    blocks[:] = 0.0
    for n in range(len(mass)):
        for k in range(9):
            value = inertia[n, k] * factor
            for w in range(LANES):
                blocks[n, 6 * (k // 3) + k % 3, w] = value
        for k in range(3):
            for w in range(LANES):
                blocks[n, 21 + 7 * k, w] = mass[n] * factor
        for w in range(LANES):
            blocks[n, 35, w] += damping[n, w]


@kernel
def add_connectors(
    first: Index, second: Index, block: Index, a: Array, b: Array, C: Array, Q: Array, d: Array, blocks: Array
) -> None:
    """Add J^T C J of every connector; ``block`` is that of (second, first), or -1 when ``first`` is a driving rod."""
    for c in range(len(first)):
        i, j, k = first[c], second[c], block[c]
        bx, by, bz = b[c, 0], b[c, 1], b[c, 2]
        for w in range(LANES):
            q0, q1, q2 = Q[c, 0, w], Q[c, 1, w], Q[c, 2, w]
            q3, q4, q5 = Q[c, 3, w], Q[c, 4, w], Q[c, 5, w]
            q6, q7, q8 = Q[c, 6, w], Q[c, 7, w], Q[c, 8, w]
            cx, cy, cz = C[c, 3, w], C[c, 4, w], C[c, 5, w]
            # P = Q^T C_t Q (symmetric), T = Q^T C_o Q
            p00 = cx * q0 * q0 + cy * q3 * q3 + cz * q6 * q6
            p01 = cx * q0 * q1 + cy * q3 * q4 + cz * q6 * q7
            p02 = cx * q0 * q2 + cy * q3 * q5 + cz * q6 * q8
            p11 = cx * q1 * q1 + cy * q4 * q4 + cz * q7 * q7
            p12 = cx * q1 * q2 + cy * q4 * q5 + cz * q7 * q8
            p22 = cx * q2 * q2 + cy * q5 * q5 + cz * q8 * q8
            ox, oy, oz = C[c, 0, w], C[c, 1, w], C[c, 2, w]
            t00 = ox * q0 * q0 + oy * q3 * q3 + oz * q6 * q6
            t01 = ox * q0 * q1 + oy * q3 * q4 + oz * q6 * q7
            t02 = ox * q0 * q2 + oy * q3 * q5 + oz * q6 * q8
            t11 = ox * q1 * q1 + oy * q4 * q4 + oz * q7 * q7
            t12 = ox * q1 * q2 + oy * q4 * q5 + oz * q7 * q8
            t22 = ox * q2 * q2 + oy * q5 * q5 + oz * q8 * q8
            # U = b~ P, the moment-force block; b~ P b~^T the moment-moment block
            u00, u01, u02 = by * p02 - bz * p01, by * p12 - bz * p11, by * p22 - bz * p12
            u10, u11, u12 = bz * p00 - bx * p02, bz * p01 - bx * p12, bz * p02 - bx * p22
            u20, u21, u22 = bx * p01 - by * p00, bx * p11 - by * p01, bx * p12 - by * p02
            m00, m01, m02 = u02 * by - u01 * bz, u00 * bz - u02 * bx, u01 * bx - u00 * by
            m11, m12 = u10 * bz - u12 * bx, u11 * bx - u10 * by
            m22 = u21 * bx - u20 * by
            blocks[j, 0, w] += t00 + m00
            blocks[j, 6, w] += t01 + m01
            blocks[j, 7, w] += t11 + m11
            blocks[j, 12, w] += t02 + m02
            blocks[j, 13, w] += t12 + m12
            blocks[j, 14, w] += t22 + m22
            blocks[j, 18, w] += u00
            blocks[j, 19, w] += u10
            blocks[j, 20, w] += u20
            blocks[j, 21, w] += p00
            blocks[j, 24, w] += u01
            blocks[j, 25, w] += u11
            blocks[j, 26, w] += u21
            blocks[j, 27, w] += p01
            blocks[j, 28, w] += p11
            blocks[j, 30, w] += u02
            blocks[j, 31, w] += u12
            blocks[j, 32, w] += u22
            blocks[j, 33, w] += p02
            blocks[j, 34, w] += p12
            blocks[j, 35, w] += p22
        if k < 0:
            continue
        ax, ay, az = a[c, 0], a[c, 1], a[c, 2]
        for w in range(LANES):
            q0, q1, q2 = Q[c, 0, w], Q[c, 1, w], Q[c, 2, w]
            q3, q4, q5 = Q[c, 3, w], Q[c, 4, w], Q[c, 5, w]
            q6, q7, q8 = Q[c, 6, w], Q[c, 7, w], Q[c, 8, w]
            cx, cy, cz = C[c, 3, w], C[c, 4, w], C[c, 5, w]
            ox, oy, oz = C[c, 0, w], C[c, 1, w], C[c, 2, w]
            ex, ey, ez = ax + d[c, 0, w], ay + d[c, 1, w], az + d[c, 2, w]
            blocks[i, 0, w] += ox + ez * ez * cy + ey * ey * cz
            blocks[i, 6, w] -= ex * ey * cz
            blocks[i, 7, w] += oy + ez * ez * cx + ex * ex * cz
            blocks[i, 12, w] -= ex * ez * cy
            blocks[i, 13, w] -= ey * ez * cx
            blocks[i, 14, w] += oz + ey * ey * cx + ex * ex * cy
            blocks[i, 19, w] += ez * cx
            blocks[i, 20, w] -= ey * cx
            blocks[i, 24, w] -= ez * cy
            blocks[i, 26, w] += ex * cy
            blocks[i, 30, w] += ey * cz
            blocks[i, 31, w] -= ex * cz
            blocks[i, 21, w] += cx
            blocks[i, 28, w] += cy
            blocks[i, 35, w] += cz
            # block (second, first): rows of J_second^T C J_first; F = Q^T C_t
            f00, f01, f02 = q0 * cx, q3 * cy, q6 * cz
            f10, f11, f12 = q1 * cx, q4 * cy, q7 * cz
            f20, f21, f22 = q2 * cx, q5 * cy, q8 * cz
            # F e~, the force-moment part
            g00, g01, g02 = f01 * ez - f02 * ey, f02 * ex - f00 * ez, f00 * ey - f01 * ex
            g10, g11, g12 = f11 * ez - f12 * ey, f12 * ex - f10 * ez, f10 * ey - f11 * ex
            g20, g21, g22 = f21 * ez - f22 * ey, f22 * ex - f20 * ez, f20 * ey - f21 * ex
            blocks[k, 18, w] += g00
            blocks[k, 19, w] += g01
            blocks[k, 20, w] += g02
            blocks[k, 24, w] += g10
            blocks[k, 25, w] += g11
            blocks[k, 26, w] += g12
            blocks[k, 30, w] += g20
            blocks[k, 31, w] += g21
            blocks[k, 32, w] += g22
            blocks[k, 21, w] -= f00
            blocks[k, 22, w] -= f01
            blocks[k, 23, w] -= f02
            blocks[k, 27, w] -= f10
            blocks[k, 28, w] -= f11
            blocks[k, 29, w] -= f12
            blocks[k, 33, w] -= f20
            blocks[k, 34, w] -= f21
            blocks[k, 35, w] -= f22
            blocks[k, 0, w] += by * g20 - bz * g10 - q0 * ox
            blocks[k, 1, w] += by * g21 - bz * g11 - q3 * oy
            blocks[k, 2, w] += by * g22 - bz * g12 - q6 * oz
            blocks[k, 6, w] += bz * g00 - bx * g20 - q1 * ox
            blocks[k, 7, w] += bz * g01 - bx * g21 - q4 * oy
            blocks[k, 8, w] += bz * g02 - bx * g22 - q7 * oz
            blocks[k, 12, w] += bx * g10 - by * g00 - q2 * ox
            blocks[k, 13, w] += bx * g11 - by * g01 - q5 * oy
            blocks[k, 14, w] += bx * g12 - by * g02 - q8 * oz
            blocks[k, 3, w] -= by * f20 - bz * f10
            blocks[k, 4, w] -= by * f21 - bz * f11
            blocks[k, 5, w] -= by * f22 - bz * f12
            blocks[k, 9, w] -= bz * f00 - bx * f20
            blocks[k, 10, w] -= bz * f01 - bx * f21
            blocks[k, 11, w] -= bz * f02 - bx * f22
            blocks[k, 15, w] -= bx * f10 - by * f00
            blocks[k, 16, w] -= bx * f11 - by * f01
            blocks[k, 17, w] -= bx * f12 - by * f02


@kernel
def _cholesky(A: Array) -> None:
    """Factor one symmetric 6 x 6 block [36, W] in place; the diagonal is stored inverted."""
    for j in range(6):
        for w in range(LANES):
            total = A[7 * j, w]
            for k in range(j):
                total -= A[6 * j + k, w] * A[6 * j + k, w]
            A[7 * j, w] = 1.0 / math.sqrt(total)
        for i in range(j + 1, 6):
            for w in range(LANES):
                total = A[6 * i + j, w]
                for k in range(j):
                    total -= A[6 * i + k, w] * A[6 * j + k, w]
                A[6 * i + j, w] = total * A[7 * j, w]


@kernel
def _scale(L: Array, A: Array) -> None:
    """A <- A L^-T for a factored diagonal block L."""
    for i in range(6):
        for j in range(6):
            for w in range(LANES):
                total = A[6 * i + j, w]
                for k in range(j):
                    total -= A[6 * i + k, w] * L[6 * j + k, w]
                A[6 * i + j, w] = total * L[7 * j, w]


@kernel
def _subtract_product(A: Array, B: Array, C: Array) -> None:
    """C <- C - A B^T."""
    for i in range(0, 36, 6):
        for j in range(0, 36, 6):
            t = i + j // 6
            for w in range(LANES):
                C[t, w] -= (
                    A[i, w] * B[j, w]
                    + A[i + 1, w] * B[j + 1, w]
                    + A[i + 2, w] * B[j + 2, w]
                    + A[i + 3, w] * B[j + 3, w]
                    + A[i + 4, w] * B[j + 4, w]
                    + A[i + 5, w] * B[j + 5, w]
                )


@kernel
def factor(start: Index, below: Index, products: Index, product_start: Index, blocks: Array) -> None:
    """Cholesky of the block matrix in place.

    ``below[start[n]:start[n + 1]]`` are the blocks under diagonal block n; the products to subtract after column n are
    rows ``product_start[n]:product_start[n + 1]`` of ``products`` (target, left, right).
    """
    for n in range(len(start) - 1):
        _cholesky(blocks[n])
        for s in range(start[n], start[n + 1]):
            _scale(blocks[n], blocks[below[s]])
        for s in range(product_start[n], product_start[n + 1]):
            _subtract_product(blocks[products[s, 1]], blocks[products[s, 2]], blocks[products[s, 0]])


@kernel
def _forward(start: Index, below: Index, row: Index, blocks: Array, x: Array) -> None:
    """x <- L^-1 x."""
    for n in range(len(start) - 1):
        for i in range(6):
            for w in range(LANES):
                total = x[n, i, w]
                for k in range(i):
                    total -= blocks[n, 6 * i + k, w] * x[n, k, w]
                x[n, i, w] = total * blocks[n, 7 * i, w]
        for s in range(start[n], start[n + 1]):
            m, r = below[s], row[s]
            for i in range(6):
                for w in range(LANES):
                    total = x[r, i, w]
                    for k in range(6):
                        total -= blocks[m, 6 * i + k, w] * x[n, k, w]
                    x[r, i, w] = total


@kernel
def _backward(start: Index, below: Index, row: Index, blocks: Array, x: Array) -> None:
    """x <- L^-T x."""
    for n in range(len(start) - 2, -1, -1):
        for s in range(start[n], start[n + 1]):
            m, r = below[s], row[s]
            for i in range(6):
                for w in range(LANES):
                    total = x[n, i, w]
                    for k in range(6):
                        total -= blocks[m, 6 * k + i, w] * x[r, k, w]
                    x[n, i, w] = total
        for i in range(5, -1, -1):
            for w in range(LANES):
                total = x[n, i, w]
                for k in range(i + 1, 6):
                    total -= blocks[n, 6 * k + i, w] * x[n, k, w]
                x[n, i, w] = total * blocks[n, 7 * i, w]


@kernel
def solve(start: Index, below: Index, row: Index, blocks: Array, x: Array) -> None:
    """Solve L L^T x = x in place for x [N, 6, W]; ``row`` gives the body row of each block in ``below``."""
    _forward(start, below, row, blocks, x)
    _backward(start, below, row, blocks, x)
