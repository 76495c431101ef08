"""The block-sparse linear system of a step: S = M / (h gamma) + sum of J^T (D + h gamma K) J over the connectors.

S is symmetric positive definite for every genome, so it is factored as L L^T without pivoting. ``blocks`` [NB, 36, W]
holds the 6 x 6 blocks: first the N diagonal ones, then those below the diagonal (``row`` > ``column``) including fill.
The symbolic factorisation (``sim.structure``) lists, in order, which blocks to scale and which products to subtract.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sim.kernels.jit import kernel
from sim.kernels.vector import load, load1, root, store, store1

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


@kernel
def start_blocks(mass: Array, inertia: Array, factor: float, damping: Array, blocks: Array) -> None:
    """Set the blocks to the inertia times ``factor`` plus ``damping`` [N, W] along each body's normal."""
    blocks[:] = 0.0
    for n in range(len(mass)):
        for k in range(9):
            value = inertia[n, k] * factor
            store(blocks, n, 6 * (k // 3) + k % 3, value)
        for k in range(3):
            store(blocks, n, 21 + 7 * k, mass[n] * factor)
        store(blocks, n, 35, load(blocks, n, 35) + load1(damping, n))


@kernel
def add_connectors(
    first: Index, second: Index, block: Index, a: Array, b: Array, C: Array, Q: Array, d: Array, blocks: Array
) -> None:
    """Add J^T C J of every connector; ``block`` is that of (second, first), or -1 when ``first`` is a driving rod."""
    for c in range(len(first)):
        i, j, k = first[c], second[c], block[c]
        bx, by, bz = b[c, 0], b[c, 1], b[c, 2]
        q0, q1, q2 = load(Q, c, 0), load(Q, c, 1), load(Q, c, 2)
        q3, q4, q5 = load(Q, c, 3), load(Q, c, 4), load(Q, c, 5)
        q6, q7, q8 = load(Q, c, 6), load(Q, c, 7), load(Q, c, 8)
        cx, cy, cz = load(C, c, 3), load(C, c, 4), load(C, c, 5)
        # P = Q^T C_t Q (symmetric), T = Q^T C_o Q
        p00 = cx * q0 * q0 + cy * q3 * q3 + cz * q6 * q6
        p01 = cx * q0 * q1 + cy * q3 * q4 + cz * q6 * q7
        p02 = cx * q0 * q2 + cy * q3 * q5 + cz * q6 * q8
        p11 = cx * q1 * q1 + cy * q4 * q4 + cz * q7 * q7
        p12 = cx * q1 * q2 + cy * q4 * q5 + cz * q7 * q8
        p22 = cx * q2 * q2 + cy * q5 * q5 + cz * q8 * q8
        ox, oy, oz = load(C, c, 0), load(C, c, 1), load(C, c, 2)
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
        store(blocks, j, 0, load(blocks, j, 0) + t00 + m00)
        store(blocks, j, 6, load(blocks, j, 6) + t01 + m01)
        store(blocks, j, 7, load(blocks, j, 7) + t11 + m11)
        store(blocks, j, 12, load(blocks, j, 12) + t02 + m02)
        store(blocks, j, 13, load(blocks, j, 13) + t12 + m12)
        store(blocks, j, 14, load(blocks, j, 14) + t22 + m22)
        store(blocks, j, 18, load(blocks, j, 18) + u00)
        store(blocks, j, 19, load(blocks, j, 19) + u10)
        store(blocks, j, 20, load(blocks, j, 20) + u20)
        store(blocks, j, 21, load(blocks, j, 21) + p00)
        store(blocks, j, 24, load(blocks, j, 24) + u01)
        store(blocks, j, 25, load(blocks, j, 25) + u11)
        store(blocks, j, 26, load(blocks, j, 26) + u21)
        store(blocks, j, 27, load(blocks, j, 27) + p01)
        store(blocks, j, 28, load(blocks, j, 28) + p11)
        store(blocks, j, 30, load(blocks, j, 30) + u02)
        store(blocks, j, 31, load(blocks, j, 31) + u12)
        store(blocks, j, 32, load(blocks, j, 32) + u22)
        store(blocks, j, 33, load(blocks, j, 33) + p02)
        store(blocks, j, 34, load(blocks, j, 34) + p12)
        store(blocks, j, 35, load(blocks, j, 35) + p22)
        if k < 0:
            continue
        ax, ay, az = a[c, 0], a[c, 1], a[c, 2]
        q0, q1, q2 = load(Q, c, 0), load(Q, c, 1), load(Q, c, 2)
        q3, q4, q5 = load(Q, c, 3), load(Q, c, 4), load(Q, c, 5)
        q6, q7, q8 = load(Q, c, 6), load(Q, c, 7), load(Q, c, 8)
        cx, cy, cz = load(C, c, 3), load(C, c, 4), load(C, c, 5)
        ox, oy, oz = load(C, c, 0), load(C, c, 1), load(C, c, 2)
        ex, ey, ez = ax + load(d, c, 0), ay + load(d, c, 1), az + load(d, c, 2)
        store(blocks, i, 0, load(blocks, i, 0) + ox + ez * ez * cy + ey * ey * cz)
        store(blocks, i, 6, load(blocks, i, 6) - ex * ey * cz)
        store(blocks, i, 7, load(blocks, i, 7) + oy + ez * ez * cx + ex * ex * cz)
        store(blocks, i, 12, load(blocks, i, 12) - ex * ez * cy)
        store(blocks, i, 13, load(blocks, i, 13) - ey * ez * cx)
        store(blocks, i, 14, load(blocks, i, 14) + oz + ey * ey * cx + ex * ex * cy)
        store(blocks, i, 19, load(blocks, i, 19) + ez * cx)
        store(blocks, i, 20, load(blocks, i, 20) - ey * cx)
        store(blocks, i, 24, load(blocks, i, 24) - ez * cy)
        store(blocks, i, 26, load(blocks, i, 26) + ex * cy)
        store(blocks, i, 30, load(blocks, i, 30) + ey * cz)
        store(blocks, i, 31, load(blocks, i, 31) - ex * cz)
        store(blocks, i, 21, load(blocks, i, 21) + cx)
        store(blocks, i, 28, load(blocks, i, 28) + cy)
        store(blocks, i, 35, load(blocks, i, 35) + cz)
        # block (second, first): rows of J_second^T C J_first; F = Q^T C_t
        f00, f01, f02 = q0 * cx, q3 * cy, q6 * cz
        f10, f11, f12 = q1 * cx, q4 * cy, q7 * cz
        f20, f21, f22 = q2 * cx, q5 * cy, q8 * cz
        # F e~, the force-moment part
        g00, g01, g02 = f01 * ez - f02 * ey, f02 * ex - f00 * ez, f00 * ey - f01 * ex
        g10, g11, g12 = f11 * ez - f12 * ey, f12 * ex - f10 * ez, f10 * ey - f11 * ex
        g20, g21, g22 = f21 * ez - f22 * ey, f22 * ex - f20 * ez, f20 * ey - f21 * ex
        store(blocks, k, 18, load(blocks, k, 18) + g00)
        store(blocks, k, 19, load(blocks, k, 19) + g01)
        store(blocks, k, 20, load(blocks, k, 20) + g02)
        store(blocks, k, 24, load(blocks, k, 24) + g10)
        store(blocks, k, 25, load(blocks, k, 25) + g11)
        store(blocks, k, 26, load(blocks, k, 26) + g12)
        store(blocks, k, 30, load(blocks, k, 30) + g20)
        store(blocks, k, 31, load(blocks, k, 31) + g21)
        store(blocks, k, 32, load(blocks, k, 32) + g22)
        store(blocks, k, 21, load(blocks, k, 21) - f00)
        store(blocks, k, 22, load(blocks, k, 22) - f01)
        store(blocks, k, 23, load(blocks, k, 23) - f02)
        store(blocks, k, 27, load(blocks, k, 27) - f10)
        store(blocks, k, 28, load(blocks, k, 28) - f11)
        store(blocks, k, 29, load(blocks, k, 29) - f12)
        store(blocks, k, 33, load(blocks, k, 33) - f20)
        store(blocks, k, 34, load(blocks, k, 34) - f21)
        store(blocks, k, 35, load(blocks, k, 35) - f22)
        store(blocks, k, 0, load(blocks, k, 0) + by * g20 - bz * g10 - q0 * ox)
        store(blocks, k, 1, load(blocks, k, 1) + by * g21 - bz * g11 - q3 * oy)
        store(blocks, k, 2, load(blocks, k, 2) + by * g22 - bz * g12 - q6 * oz)
        store(blocks, k, 6, load(blocks, k, 6) + bz * g00 - bx * g20 - q1 * ox)
        store(blocks, k, 7, load(blocks, k, 7) + bz * g01 - bx * g21 - q4 * oy)
        store(blocks, k, 8, load(blocks, k, 8) + bz * g02 - bx * g22 - q7 * oz)
        store(blocks, k, 12, load(blocks, k, 12) + bx * g10 - by * g00 - q2 * ox)
        store(blocks, k, 13, load(blocks, k, 13) + bx * g11 - by * g01 - q5 * oy)
        store(blocks, k, 14, load(blocks, k, 14) + bx * g12 - by * g02 - q8 * oz)
        store(blocks, k, 3, load(blocks, k, 3) - (by * f20 - bz * f10))
        store(blocks, k, 4, load(blocks, k, 4) - (by * f21 - bz * f11))
        store(blocks, k, 5, load(blocks, k, 5) - (by * f22 - bz * f12))
        store(blocks, k, 9, load(blocks, k, 9) - (bz * f00 - bx * f20))
        store(blocks, k, 10, load(blocks, k, 10) - (bz * f01 - bx * f21))
        store(blocks, k, 11, load(blocks, k, 11) - (bz * f02 - bx * f22))
        store(blocks, k, 15, load(blocks, k, 15) - (bx * f10 - by * f00))
        store(blocks, k, 16, load(blocks, k, 16) - (bx * f11 - by * f01))
        store(blocks, k, 17, load(blocks, k, 17) - (bx * f12 - by * f02))


@kernel
def _cholesky(A: Array) -> None:
    """Factor one symmetric 6 x 6 block [36, W] in place; the diagonal is stored inverted."""
    for j in range(6):
        total = load1(A, 7 * j)
        for k in range(j):
            total -= load1(A, 6 * j + k) * load1(A, 6 * j + k)
        store1(A, 7 * j, 1.0 / root(total))
        for i in range(j + 1, 6):
            total = load1(A, 6 * i + j)
            for k in range(j):
                total -= load1(A, 6 * i + k) * load1(A, 6 * j + k)
            store1(A, 6 * i + j, total * load1(A, 7 * j))


@kernel
def _scale(L: Array, A: Array) -> None:
    """A <- A L^-T for a factored diagonal block L."""
    for i in range(6):
        for j in range(6):
            total = load1(A, 6 * i + j)
            for k in range(j):
                total -= load1(A, 6 * i + k) * load1(L, 6 * j + k)
            store1(A, 6 * i + j, total * load1(L, 7 * j))


@kernel
def _subtract_product(A: Array, B: Array, C: Array) -> None:
    """C <- C - A B^T, a row of C at a time in registers."""
    for i in range(0, 36, 6):
        c0, c1, c2 = load1(C, i), load1(C, i + 1), load1(C, i + 2)
        c3, c4, c5 = load1(C, i + 3), load1(C, i + 4), load1(C, i + 5)
        for k in range(6):
            a = load1(A, i + k)
            c0 -= a * load1(B, k)
            c1 -= a * load1(B, 6 + k)
            c2 -= a * load1(B, 12 + k)
            c3 -= a * load1(B, 18 + k)
            c4 -= a * load1(B, 24 + k)
            c5 -= a * load1(B, 30 + k)
        store1(C, i, c0)
        store1(C, i + 1, c1)
        store1(C, i + 2, c2)
        store1(C, i + 3, c3)
        store1(C, i + 4, c4)
        store1(C, i + 5, c5)


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
            total = load(x, n, i)
            for k in range(i):
                total -= load(blocks, n, 6 * i + k) * load(x, n, k)
            store(x, n, i, total * load(blocks, n, 7 * i))
        for s in range(start[n], start[n + 1]):
            m, r = below[s], row[s]
            y0, y1, y2 = load(x, n, 0), load(x, n, 1), load(x, n, 2)
            y3, y4, y5 = load(x, n, 3), load(x, n, 4), load(x, n, 5)
            for i in range(6):
                total = load(x, r, i) - load(blocks, m, 6 * i) * y0 - load(blocks, m, 6 * i + 1) * y1
                total = total - load(blocks, m, 6 * i + 2) * y2 - load(blocks, m, 6 * i + 3) * y3
                store(x, r, i, total - load(blocks, m, 6 * i + 4) * y4 - load(blocks, m, 6 * i + 5) * y5)


@kernel
def _backward(start: Index, below: Index, row: Index, blocks: Array, x: Array) -> None:
    """x <- L^-T x."""
    for n in range(len(start) - 2, -1, -1):
        for s in range(start[n], start[n + 1]):
            m, r = below[s], row[s]
            y0, y1, y2 = load(x, r, 0), load(x, r, 1), load(x, r, 2)
            y3, y4, y5 = load(x, r, 3), load(x, r, 4), load(x, r, 5)
            for i in range(6):
                total = load(x, n, i) - load(blocks, m, i) * y0 - load(blocks, m, 6 + i) * y1
                total = total - load(blocks, m, 12 + i) * y2 - load(blocks, m, 18 + i) * y3
                store(x, n, i, total - load(blocks, m, 24 + i) * y4 - load(blocks, m, 30 + i) * y5)
        for i in range(5, -1, -1):
            total = load(x, n, i)
            for k in range(i + 1, 6):
                total -= load(blocks, n, 6 * k + i) * load(x, n, k)
            store(x, n, i, total * load(blocks, n, 7 * i))


@kernel
def solve(start: Index, below: Index, row: Index, blocks: Array, x: Array) -> None:
    """Solve L L^T x = x in place for x [N, 6, W]; ``row`` gives the body row of each block in ``below``."""
    _forward(start, below, row, blocks, x)
    _backward(start, below, row, blocks, x)
