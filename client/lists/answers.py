"""JSON answers about lists, and the orders in which lists come."""

from __future__ import annotations

from typing import Literal

from typing_extensions import TypedDict

RunSort = Literal[
    "created_at",
    "name",
    "dataset",
    "state",
    "misfit",
    "residual_over_noise",
    "held_out_over_noise",
    "fit",
    "model",
    "method",
    "generations",
]
DiagnosisSort = Literal[
    "created_at", "name", "dataset", "state", "verdict", "residual_over_noise", "held_out_over_noise", "fit", "model"
]
DatasetSort = Literal["created_at", "name", "kind", "recordings", "held_out", "size_bytes"]
Order = Literal["asc", "desc"]


class JobGroup(TypedDict):
    """A dataset with ``count`` runs (or diagnoses) that a list contains."""

    dataset_id: str
    dataset_name: str
    count: int
