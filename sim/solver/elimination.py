"""In which order to eliminate the bodies from the step's linear system, and the work that this makes.

Minimum degree (Rose 1972): always the body with the fewest neighbours left, of these the one that joins the fewest
pairs of them anew. On a wing of four bodies along the chord this saves a fifth of the products of strip by strip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import ArrayLike, Index

_NONE: frozenset[tuple[int, int]] = frozenset()


@dataclass(frozen=True)
class Elimination:
    """Blocks and products of the factorisation, numbered as in ``wingfit.sim.kernels.linear``.

    Attributes:
        order: bodies as they are eliminated.
        start: below[start[k]:start[k + 1]] are the blocks under the diagonal of order[k].
        below: their numbers.
        row: the body in whose row each of them is.
        products: (target, left, right) to subtract.
        product_start: rows product_start[k]:product_start[k + 1] of ``products`` follow the elimination of order[k].
        fill: blocks that no connector writes.
        position: number of the block (row, column) of two joined bodies.
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
    n: int, pairs: set[tuple[int, int]], beside: frozenset[tuple[int, int]] | set[tuple[int, int]] = _NONE
) -> Elimination:
    """Elimination of n bodies of which ``pairs`` are joined by connectors (either way round), and others ``beside``."""
    columns = _minimum_degree(n, pairs | beside)
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
    """Bodies in the order of elimination, each with the neighbours it still has then."""
    left: dict[int, set[int]] = {k: set() for k in range(n)}
    for a, b in pairs:
        left[a].add(b)
        left[b].add(a)

    def price(body: int) -> tuple[int, int, int]:
        around = sorted(left[body])
        anew = sum(b not in left[a] for k, a in enumerate(around) for b in around[k + 1 :])
        return len(around), anew, body

    columns = []
    while left:
        body = min(left, key=price)
        around = left.pop(body)
        for neighbour in around:
            left[neighbour] = (left[neighbour] | around) - {neighbour, body}
        columns.append((body, sorted(around)))
    return columns


def _index(values: ArrayLike) -> Index:
    return np.asarray(values, np.int64)
