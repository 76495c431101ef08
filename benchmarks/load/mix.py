"""What is read, and how often: as where a few people follow a run, and others look into old ones.

Of ten reads six are of a run, two of the list of runs, 50 to a page, and two of 50 generations of a history.
Half of the runs and histories are those of the run under way, the others of any run; of ten lists nine are the first
page, the others any page. Any is drawn anew among all that are stored: a server which remembers is not flattered.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import httpx
import numpy as np

KINDS = ("run", "list", "history")
SHARES = (0.6, 0.2, 0.2)
UNDER_WAY, FIRST_PAGE = 0.5, 0.9
PAGE = 50


@dataclass(frozen=True)
class Stored:
    """What a list of runs told: their ids, newest first, the cursors to its pages, and the generations of each."""

    ids: Sequence[str]
    cursors: Sequence[str]
    generations: Sequence[int]


def walk(http: httpx.Client) -> Stored:
    """Turn all pages of the list of runs."""
    ids, cursors, generations, cursor = list[str](), list[str](), list[int](), None
    while True:
        page = http.get("/v1/runs", params={"limit": PAGE} | ({"cursor": cursor} if cursor else {})).json()
        ids += [run["id"] for run in page["items"]]
        generations += [run["generations"] for run in page["items"]]
        cursor = page["next_cursor"]
        if cursor is None:
            return Stored(ids, cursors, generations)
        cursors.append(cursor)


def reads(stored: Stored, under_way: str, number: int, seed: int) -> list[tuple[str, str]]:
    """``number`` reads, each its kind and its path."""
    rng = np.random.default_rng(seed)
    return [_read(KINDS[kind], stored, under_way, rng) for kind in rng.choice(len(KINDS), number, p=SHARES)]


def _read(kind: str, stored: Stored, under_way: str, rng: np.random.Generator) -> tuple[str, str]:
    if kind == "list":
        further = rng.random() >= FIRST_PAGE and stored.cursors
        cursor = f"&cursor={stored.cursors[int(rng.integers(len(stored.cursors)))]}" if further else ""
        return kind, f"/v1/runs?limit={PAGE}{cursor}"
    place = int(rng.integers(len(stored.ids)))
    run, generations = stored.ids[place], stored.generations[place]
    if rng.random() < UNDER_WAY:
        run, generations = under_way, PAGE
    if kind == "run":
        return kind, f"/v1/runs/{run}"
    return kind, f"/v1/runs/{run}/history?after={rng.integers(max(1, generations - PAGE))}&limit={PAGE}"
