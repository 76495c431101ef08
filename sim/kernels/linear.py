"""The block-sparse linear system of a step, solved by block LU.

The exact linearisation of the wing is not symmetric: dampers rotate with the bodies, wrenches have moments. Pivots are
6 x 6 blocks without pivoting: inertia over the step and dissipation make the diagonal dominant. ``blocks``
[NB, 36, W] holds the N diagonal blocks, then those below the diagonal (rows eliminated later, including fill), then as
many above it, in the same order, and last the columns of the driving rods, which are known and not factored.
``wingfit.sim.solver.elimination`` lists the blocks and the products to subtract, in the order of elimination.
"""

from __future__ import annotations

from wingfit.records.array_types import Array, Index
from wingfit.sim.kernels.jit import kernel
from wingfit.sim.kernels.lanes.vector import load, load1, store, store1


@kernel
def _invert(A: Array) -> None:
    """Replace one 6 x 6 block [36, W] by its inverse, by Gauss-Jordan elimination."""
    for p in range(6):
        pivot = 1.0 / load1(A, 7 * p)
        store1(A, 7 * p, 1.0)
        for j in range(6):
            store1(A, 6 * p + j, load1(A, 6 * p + j) * pivot)
        r0, r1, r2 = load1(A, 6 * p), load1(A, 6 * p + 1), load1(A, 6 * p + 2)
        r3, r4, r5 = load1(A, 6 * p + 3), load1(A, 6 * p + 4), load1(A, 6 * p + 5)
        for i in range(6):
            if i != p:
                m = load1(A, 6 * i + p)
                store1(A, 6 * i + p, 0.0)
                store1(A, 6 * i, load1(A, 6 * i) - m * r0)
                store1(A, 6 * i + 1, load1(A, 6 * i + 1) - m * r1)
                store1(A, 6 * i + 2, load1(A, 6 * i + 2) - m * r2)
                store1(A, 6 * i + 3, load1(A, 6 * i + 3) - m * r3)
                store1(A, 6 * i + 4, load1(A, 6 * i + 4) - m * r4)
                store1(A, 6 * i + 5, load1(A, 6 * i + 5) - m * r5)


@kernel
def _times_inverse(A: Array, D: Array) -> None:
    """A <- A D for 6 x 6 blocks [36, W], one row of A at a time."""
    for i in range(0, 36, 6):
        a0, a1, a2 = load1(A, i), load1(A, i + 1), load1(A, i + 2)
        a3, a4, a5 = load1(A, i + 3), load1(A, i + 4), load1(A, i + 5)
        for j in range(6):
            total = a0 * load1(D, j) + a1 * load1(D, 6 + j) + a2 * load1(D, 12 + j)
            more = a3 * load1(D, 18 + j) + a4 * load1(D, 24 + j) + a5 * load1(D, 30 + j)
            store1(A, i + j, total + more)


@kernel
def _subtract_product(A: Array, B: Array, C: Array) -> None:
    """C <- C - A B for 6 x 6 blocks [36, W], two rows of C at a time, to use both arithmetic units."""
    for i in range(0, 36, 12):
        c0, c1, c2 = load1(C, i), load1(C, i + 1), load1(C, i + 2)
        c3, c4, c5 = load1(C, i + 3), load1(C, i + 4), load1(C, i + 5)
        d0, d1, d2 = load1(C, i + 6), load1(C, i + 7), load1(C, i + 8)
        d3, d4, d5 = load1(C, i + 9), load1(C, i + 10), load1(C, i + 11)
        for k in range(6):
            a, b = load1(A, i + k), load1(A, i + 6 + k)
            x = load1(B, 6 * k)
            c0, d0 = c0 - a * x, d0 - b * x
            x = load1(B, 6 * k + 1)
            c1, d1 = c1 - a * x, d1 - b * x
            x = load1(B, 6 * k + 2)
            c2, d2 = c2 - a * x, d2 - b * x
            x = load1(B, 6 * k + 3)
            c3, d3 = c3 - a * x, d3 - b * x
            x = load1(B, 6 * k + 4)
            c4, d4 = c4 - a * x, d4 - b * x
            x = load1(B, 6 * k + 5)
            c5, d5 = c5 - a * x, d5 - b * x
        store1(C, i, c0)
        store1(C, i + 1, c1)
        store1(C, i + 2, c2)
        store1(C, i + 3, c3)
        store1(C, i + 4, c4)
        store1(C, i + 5, c5)
        store1(C, i + 6, d0)
        store1(C, i + 7, d1)
        store1(C, i + 8, d2)
        store1(C, i + 9, d3)
        store1(C, i + 10, d4)
        store1(C, i + 11, d5)


@kernel
def factor(order: Index, start: Index, below: Index, products: Index, product_start: Index, blocks: Array) -> None:
    """Block LU in place: inverses on the diagonal, L = A D^-1 below it, U above.

    ``below[start[k]:start[k + 1]]`` are the blocks under the diagonal block of body order[k]; the products to subtract
    after it are rows ``product_start[k]:product_start[k + 1]`` of ``products`` (target, left, right).
    """
    for k in range(len(order)):
        n = order[k]
        _invert(blocks[n])
        for s in range(start[k], start[k + 1]):
            _times_inverse(blocks[below[s]], blocks[n])
        for s in range(product_start[k], product_start[k + 1]):
            _subtract_product(blocks[products[s, 1]], blocks[products[s, 2]], blocks[products[s, 0]])


@kernel
def subtract_column(row: int, m: int, blocks: Array, known: Array, column: int, x: Array) -> None:
    """x[row] <- x[row] - block m times ``known[column]``."""
    y0, y1, y2 = load(known, column, 0), load(known, column, 1), load(known, column, 2)
    y3, y4, y5 = load(known, column, 3), load(known, column, 4), load(known, column, 5)
    for i in range(6):
        total = load(x, row, i) - load(blocks, m, 6 * i) * y0 - load(blocks, m, 6 * i + 1) * y1
        total = total - load(blocks, m, 6 * i + 2) * y2 - load(blocks, m, 6 * i + 3) * y3
        store(x, row, i, total - load(blocks, m, 6 * i + 4) * y4 - load(blocks, m, 6 * i + 5) * y5)


@kernel
def _times_block(m: int, blocks: Array, n: int, x: Array) -> None:
    """x[n] <- block m times x[n]."""
    y0, y1, y2, y3, y4, y5 = load(x, n, 0), load(x, n, 1), load(x, n, 2), load(x, n, 3), load(x, n, 4), load(x, n, 5)
    for i in range(6):
        total = load(blocks, m, 6 * i) * y0 + load(blocks, m, 6 * i + 1) * y1 + load(blocks, m, 6 * i + 2) * y2
        more = load(blocks, m, 6 * i + 3) * y3 + load(blocks, m, 6 * i + 4) * y4 + load(blocks, m, 6 * i + 5) * y5
        store(x, n, i, total + more)


@kernel
def solve(order: Index, start: Index, below: Index, row: Index, blocks: Array, x: Array) -> None:
    """Solve L U x = x in place for x [N, 6, W]; ``row`` gives the body row of each block in ``below``."""
    for k in range(len(order)):
        for s in range(start[k], start[k + 1]):
            subtract_column(row[s], below[s], blocks, x, order[k], x)
    for k in range(len(order) - 1, -1, -1):
        for s in range(start[k], start[k + 1]):
            subtract_column(order[k], below[s] + len(below), blocks, x, row[s], x)
        _times_block(order[k], blocks, order[k], x)
