"""The mix of read requests in the load test: as if a few users followed the present run, and others looked at old ones.

Of ten reads six are of a run, two of a page of the run list (50 runs), and two of a page of a run's history (50
generations). Half of the runs and histories are those of the present run; nine tenths of the run lists are the first
page. The others are drawn at random from everything that is stored, so that a cache in the server does not improve the
figures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import httpx
import numpy as np

KINDS = ("run", "list", "history")
SHARES = (0.6, 0.2, 0.2)
PRESENT_RUN, FIRST_PAGE = 0.5, 0.9
PAGE = 50


@dataclass(frozen=True)
class Stored:
    """The stored runs: ids, newest first; cursors of the list's pages; number of generations of each run."""

    ids: Sequence[str]
    cursors: Sequence[str]
    generations: Sequence[int]


def walk(http: httpx.Client) -> Stored:
    """Read all pages of the server's run list, and return the stored runs."""
    ids, cursors, generations, cursor = list[str](), list[str](), list[int](), None
    while True:
        page = http.get("/v1/runs", params={"limit": PAGE} | ({"cursor": cursor} if cursor else {})).json()
        ids += [run["id"] for run in page["items"]]
        generations += [run["generations"] for run in page["items"]]
        cursor = page["next_cursor"]
        if cursor is None:
            return Stored(ids, cursors, generations)
        cursors.append(cursor)


def reads(stored: Stored, present: str, number: int, seed: int) -> list[tuple[str, str]]:
    """Draw ``number`` random reads, each as (kind, URL path); ``present``: id of the run that is being computed."""
    rng = np.random.default_rng(seed)
    return [_read(KINDS[kind], stored, present, rng) for kind in rng.choice(len(KINDS), number, p=SHARES)]


def _read(kind: str, stored: Stored, present: str, rng: np.random.Generator) -> tuple[str, str]:
    if kind == "list":
        further = rng.random() >= FIRST_PAGE and stored.cursors
        cursor = f"&cursor={stored.cursors[int(rng.integers(len(stored.cursors)))]}" if further else ""
        return kind, f"/v1/runs?limit={PAGE}{cursor}"
    place = int(rng.integers(len(stored.ids)))
    run, generations = stored.ids[place], stored.generations[place]
    if rng.random() < PRESENT_RUN:
        run, generations = present, PAGE
    if kind == "run":
        return kind, f"/v1/runs/{run}"
    return kind, f"/v1/runs/{run}/history?after={rng.integers(max(1, generations - PAGE))}&limit={PAGE}"
