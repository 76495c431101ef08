"""Solve the block-sparse linear system of a step by block LU, for W individuals at a time.

The matrix is not symmetric, because dampers and the moments of wrenches turn with the bodies. It is eliminated in 6 x 6
blocks, without exchanging rows: inertia and damping make the diagonal dominant. ``blocks`` [NB, 36, W] (NB blocks, row
by row) holds the N diagonal blocks, one for each body, then those below the diagonal (rows eliminated later, including
fill), then as many above it, in the same order, and last the columns of the driving rods, which are known and not
factored. ``wingfit.sim.solver.elimination`` lists the blocks and the products to subtract, in the order of elimination.
"""

from __future__ import annotations

from typing import Any

from wingfit.records.array_types import Array, Index
from wingfit.sim.kernels.jit import inlined, kernel
from wingfit.sim.kernels.lanes.vector import Vector, load, load1, store, store1


@inlined
def _row(A: Array, i: int) -> tuple[Vector, Vector, Vector, Vector, Vector, Vector]:
    """Load elements i to i + 5 of a block [36, W]."""
    return load1(A, i), load1(A, i + 1), load1(A, i + 2), load1(A, i + 3), load1(A, i + 4), load1(A, i + 5)


@inlined
def _set_row(A: Array, i: int, x: Any) -> None:
    """Store six vectors ``x`` as the elements i to i + 5 of a block [36, W]."""
    store1(A, i, x[0])
    store1(A, i + 1, x[1])
    store1(A, i + 2, x[2])
    store1(A, i + 3, x[3])
    store1(A, i + 4, x[4])
    store1(A, i + 5, x[5])


@inlined
def _minus(x: Any, m: Vector, y: Any) -> Any:
    """Return x - m y, for ``x`` and ``y`` of six vectors each."""
    a, b, c = x[0] - m * y[0], x[1] - m * y[1], x[2] - m * y[2]
    return a, b, c, x[3] - m * y[3], x[4] - m * y[4], x[5] - m * y[5]


@kernel
def _invert(A: Array) -> None:
    """Replace one 6 x 6 block [36, W] by its inverse, by Gauss-Jordan elimination."""
    for p in range(6):
        pivot = 1.0 / load1(A, 7 * p)
        store1(A, 7 * p, 1.0)
        for j in range(6):
            store1(A, 6 * p + j, load1(A, 6 * p + j) * pivot)
        row = _row(A, 6 * p)
        for i in range(6):
            if i != p:
                m = load1(A, 6 * i + p)
                store1(A, 6 * i + p, 0.0)
                _set_row(A, 6 * i, _minus(_row(A, 6 * i), m, row))


@kernel
def _times_inverse(A: Array, D: Array) -> None:
    """Replace A by A D for 6 x 6 blocks [36, W], one row of A at a time; D is already inverted."""
    for i in range(0, 36, 6):
        a0, a1, a2 = load1(A, i), load1(A, i + 1), load1(A, i + 2)
        a3, a4, a5 = load1(A, i + 3), load1(A, i + 4), load1(A, i + 5)
        for j in range(6):
            total = a0 * load1(D, j) + a1 * load1(D, 6 + j) + a2 * load1(D, 12 + j)
            more = a3 * load1(D, 18 + j) + a4 * load1(D, 24 + j) + a5 * load1(D, 30 + j)
            store1(A, i + j, total + more)


@kernel
def _subtract_product(A: Array, B: Array, C: Array) -> None:
    """Replace C by C - A B for 6 x 6 blocks [36, W], two rows at a time, to use both arithmetic units."""
    for i in range(0, 36, 12):
        c, d = _row(C, i), _row(C, i + 6)
        for k in range(6):
            x = _row(B, 6 * k)
            c, d = _minus(c, load1(A, i + k), x), _minus(d, load1(A, i + 6 + k), x)
        _set_row(C, i, c)
        _set_row(C, i + 6, d)


@kernel
def factor(order: Index, start: Index, below: Index, products: Index, product_start: Index, blocks: Array) -> None:
    """Replace ``blocks`` by their block LU factors: inverses on the diagonal, L = A D^-1 below it, U above.

    ``order`` [N]: bodies in the order of elimination; ``below[start[k]:start[k + 1]]``: numbers of the blocks under the
    diagonal block of body order[k]; rows ``product_start[k]:product_start[k + 1]`` of ``products`` [., 3] (target,
    left, right: numbers of blocks): the products to subtract after its elimination.
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
    """Subtract block ``m`` of ``blocks`` times ``known[column]`` from ``x[row]``; ``x`` and ``known`` are [., 6, W]."""
    y0, y1, y2 = load(known, column, 0), load(known, column, 1), load(known, column, 2)
    y3, y4, y5 = load(known, column, 3), load(known, column, 4), load(known, column, 5)
    for i in range(6):
        total = load(x, row, i) - load(blocks, m, 6 * i) * y0 - load(blocks, m, 6 * i + 1) * y1
        total = total - load(blocks, m, 6 * i + 2) * y2 - load(blocks, m, 6 * i + 3) * y3
        store(x, row, i, total - load(blocks, m, 6 * i + 4) * y4 - load(blocks, m, 6 * i + 5) * y5)


@kernel
def _times_block(m: int, blocks: Array, n: int, x: Array) -> None:
    """Replace x[n] by block ``m`` of ``blocks`` times x[n]; ``x`` is [., 6, W]."""
    y0, y1, y2, y3, y4, y5 = load(x, n, 0), load(x, n, 1), load(x, n, 2), load(x, n, 3), load(x, n, 4), load(x, n, 5)
    for i in range(6):
        total = load(blocks, m, 6 * i) * y0 + load(blocks, m, 6 * i + 1) * y1 + load(blocks, m, 6 * i + 2) * y2
        more = load(blocks, m, 6 * i + 3) * y3 + load(blocks, m, 6 * i + 4) * y4 + load(blocks, m, 6 * i + 5) * y5
        store(x, n, i, total + more)


@kernel
def solve(order: Index, start: Index, below: Index, row: Index, blocks: Array, x: Array) -> None:
    """Replace the right-hand side ``x`` [N, 6, W] by the solution, given the factors in ``blocks`` (:func:`factor`).

    ``order``, ``start``, ``below`` as in :func:`factor`; ``row``: for each block of ``below``, the body whose matrix
    row it is in.
    """
    for k in range(len(order)):
        for s in range(start[k], start[k + 1]):
            subtract_column(row[s], below[s], blocks, x, order[k], x)
    for k in range(len(order) - 1, -1, -1):
        for s in range(start[k], start[k + 1]):
            subtract_column(order[k], below[s] + len(below), blocks, x, row[s], x)
        _times_block(order[k], blocks, order[k], x)
