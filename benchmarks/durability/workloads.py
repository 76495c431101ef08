"""The jobs to submit: small calibrations with tracks or forces, and a diagnosis, which all give repeatable results."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

Json = dict[str, Any]


@dataclass(frozen=True)
class Work:
    """A calibration to submit: its name, the example dataset to upload, and the request without the dataset's id."""

    name: str
    example: str
    body: Json = field(hash=False)


def _search(name: str, seed: int, **more: Any) -> Work:
    wing = {"division": "4", "population": 8, "max_generations": 10, "stall": 10, "seed": seed}
    return Work(f"{name} {seed}", "robird", wing | {"recordings": ["vac-0010mbar-lag0-2.0hz"], "mode": "joint"} | more)


WORKS = (
    *(_search("genetic", seed) for seed in (1, 2, 3)),
    _search("CMA-ES", 4, method="cma_es"),
    Work("forces, Gauss-Newton", "delfly", {"axes": ["x", "z"]}),
    Work(
        "forces, CMA-ES, then Gauss-Newton",
        "delfly",
        {"method": "cma_es", "finish": True, "population": 12, "max_generations": 12, "stall": 12, "seed": 5},
    ),
)


DIAGNOSIS: Json = {"axes": ["x", "z"], "seed": 1}
"""Diagnosis of balance recordings. It starts again after every kill of the server, and ends once the kills stop."""
DIAGNOSED = "delfly"
