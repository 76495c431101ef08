"""Response times of pages of the run list and of a long history, while a calibration uses all processors.

No page is requested twice, so that a cache in the server does not improve the figures.
"""

from __future__ import annotations

import http.client
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.load.figures import milliseconds
from benchmarks.load.filling import Filled
from benchmarks.load.mix import Stored
from wingfit.service.http.responses import HISTORY_PAGE, LARGEST_HISTORY_PAGE, LARGEST_PAGE, PAGE

Json = dict[str, Any]
PAGES, LARGEST_PAGES = 100, 20


def pages(port: int, stored: Stored, filled: Filled, dataset_id: str) -> Json:
    """Measure pages of the run list and of a history: response times (ms) and largest size (kB), by kind of page.

    ``port``: of the server; ``filled``: the long history to read; ``dataset_id``: dataset by which lists are filtered.
    """
    rng = np.random.default_rng(1)
    cursors = rng.permutation(stored.cursors)
    last = max(0, filled.longest_generations - HISTORY_PAGE - PAGES)
    history = f"/v1/runs/{filled.longest}/history"
    some: dict[str, Callable[[int], str]] = {
        "list, newest": lambda n: f"/v1/runs?limit={PAGE + n}",
        "list, any page": lambda n: f"/v1/runs?cursor={cursors[n % len(cursors)]}",
        "list, of a state": lambda n: f"/v1/runs?state=FAILED&cursor={cursors[n % len(cursors)]}",
        "list, of a dataset": lambda n: f"/v1/runs?dataset_id={dataset_id}&cursor={cursors[n % len(cursors)]}",
        "list, of both": lambda n: f"/v1/runs?dataset_id={dataset_id}&state=FAILED&limit={1 + n}",
        "list, largest page": lambda n: f"/v1/runs?limit={LARGEST_PAGE}&cursor={cursors[n % len(cursors)]}",
        "history, first page": lambda n: f"{history}?after={n}",
        "history, in the middle": lambda n: f"{history}?after={last // 2 + n}",
        "history, last page": lambda n: f"{history}?after={last + n}",
    }
    largest = [f"{history}?after={n}&limit={LARGEST_HISTORY_PAGE}" for n in range(LARGEST_PAGES)]
    paths_by_kind = {name: [path(n) for n in range(PAGES)] for name, path in some.items()}
    paths_by_kind["history, largest page"] = largest
    return {name: timed(port, paths) for name, paths in paths_by_kind.items()}


def timed(port: int, paths: list[str]) -> Json:
    """Request ``paths`` one after the other; return percentiles of the response times (ms), and the largest size (kB).

    RuntimeError if a status is not 200.
    """
    connection, took, longest = http.client.HTTPConnection("127.0.0.1", port, timeout=60.0), list[float](), 0
    for path in paths:
        start = time.perf_counter()
        connection.request("GET", path)
        response = connection.getresponse()
        body = response.read()
        took.append(time.perf_counter() - start)
        if response.status != 200:
            raise RuntimeError(f"{path} returned {response.status}: {body[:300]!r}")
        longest = max(longest, len(body))
    connection.close()
    return milliseconds(took) | {"kilobytes": round(longest / 1000, 1)}
