"""The calibrations of the load test: the example wing, with a fixed number of generations."""

from __future__ import annotations

from typing import Any

from benchmarks.common.files import EXAMPLES
from wingfit.client.client import Client

Json = dict[str, Any]
ROBIRD = EXAMPLES / "robird"


def search(division: str, population: int, generations: int, **more: Any) -> Json:
    """Return the request body of a genetic search that always computes all its ``generations``.

    ``division``: discretisation of the wing, such as "11" bodies; ``population``: individuals per generation.
    """
    size = {"division": division, "population": population, "max_generations": generations, "stall": generations}
    return size | {"mode": "joint", "tolerance": 0.0, "seed": 1} | more


# 11 bodies, all six recordings that are not held out; 4 bodies, one recording.
LONG = search("11", 32, 12)
SHORT = search("4", 8, 12, recordings=["vac-0010mbar-lag0-2.0hz"])


def computed(client: Client, run_id: str) -> tuple[float, int]:
    """Wait for a calibration to end; return the seconds and the simulated individuals from first to last generation.

    RuntimeError if it does not succeed.
    """
    ended = client.wait(run_id)
    if ended["state"] != "SUCCEEDED":
        raise RuntimeError(f"the calibration {ended['state']}: {ended['error']}")
    first, *_, last = client.history(run_id)
    return last["elapsed_seconds"] - first["elapsed_seconds"], last["evaluations"] - first["evaluations"]
