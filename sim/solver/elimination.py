"""Choose the order in which the bodies are eliminated from the step's linear system, and list the operations.

Minimum degree (Rose 1972): the next body is the one with the fewest remaining neighbours and, among these, with the
least fill (new blocks in the matrix). With four bodies along the chord this saves a fifth of the products of an
elimination strip by strip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import ArrayLike, Index

_NONE: frozenset[tuple[int, int]] = frozenset()


@dataclass(frozen=True)
class Elimination:
    """Blocks and products of a block LU factorisation, numbered as in ``wingfit.sim.kernels.linear``.

    Attributes:
        order: [N] bodies in the order of elimination.
        start: [N + 1]; below[start[k]:start[k + 1]] are the blocks under the diagonal of order[k].
        below: numbers of the blocks below the diagonal.
        row: for each block of ``below``, the body whose row of the matrix it is in.
        products: [., 3] numbers of the blocks (target, left, right): left times right is subtracted from the target.
        product_start: [N + 1]; rows product_start[k]:product_start[k + 1] of ``products`` follow the elimination of
            order[k].
        fill: numbers of the off-diagonal blocks that do not belong to a connector.
        position: number of the block at (row, column), each a body.
    """

    order: Index
    start: Index
    below: Index
    row: Index
    products: Index
    product_start: Index
    fill: Index
    position: dict[tuple[int, int], int]


def eliminate(
    n: int, pairs: set[tuple[int, int]], extra: frozenset[tuple[int, int]] | set[tuple[int, int]] = _NONE
) -> Elimination:
    """Return the elimination of ``n`` bodies from a matrix with off-diagonal blocks for some pairs of bodies.

    These are the ``pairs`` joined by connectors, and the pairs in ``extra``, such as bodies of a strip that added mass
    couples.
    """
    columns = _minimum_degree(n, pairs | extra)
    count = sum(len(rows) for _, rows in columns)
    position = {(k, k): k for k in range(n)}
    for column, rows in columns:
        for row in rows:
            position[row, column] = n + (len(position) - n) // 2
            position[column, row] = position[row, column] + count
    products = [[(position[r, q], position[r, c], position[c, q]) for q in rows for r in rows] for c, rows in columns]
    joined = {pair for a, b in pairs for pair in ((a, b), (b, a))}
    fill = [number for (r, c), number in position.items() if r != c and (r, c) not in joined]
    return Elimination(
        order=_index([column for column, _ in columns]),
        start=_index(np.cumsum([0, *(len(rows) for _, rows in columns)])),
        below=_index([position[row, column] for column, rows in columns for row in rows]),
        row=_index([row for _, rows in columns for row in rows]),
        products=_index([product for part in products for product in part]).reshape(-1, 3),
        product_start=_index(np.cumsum([0, *(len(part) for part in products)])),
        fill=_index(sorted(fill)),
        position=position,
    )


def _minimum_degree(n: int, pairs: set[tuple[int, int]]) -> list[tuple[int, list[int]]]:
    """Return the bodies in the order of elimination, each with its neighbours that are then still to be eliminated."""
    neighbours: dict[int, set[int]] = {k: set() for k in range(n)}
    for a, b in pairs:
        neighbours[a].add(b)
        neighbours[b].add(a)

    def cost(body: int) -> tuple[int, int, int]:
        around = sorted(neighbours[body])
        fill = sum(b not in neighbours[a] for k, a in enumerate(around) for b in around[k + 1 :])
        return len(around), fill, body

    columns = []
    while neighbours:
        body = min(neighbours, key=cost)
        around = neighbours.pop(body)
        for neighbour in around:
            neighbours[neighbour] = (neighbours[neighbour] | around) - {neighbour, body}
        columns.append((body, sorted(around)))
    return columns


def _index(values: ArrayLike) -> Index:
    return np.asarray(values, np.int64)
