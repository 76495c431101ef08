"""JSON answers of the server about rigs of the user's own, and to the drivers that simulate them."""

from __future__ import annotations

from typing import Any

from typing_extensions import TypedDict

from wingfit.client.answers import State


class InstalledRigs(TypedDict):
    """Names of the rigs that are installed on the server (entry points "wingfit.rigs")."""

    rigs: list[str]


class Simulation(TypedDict):
    """A simulation that a driver is to compute: one recording with values of the genes.

    ``id`` identifies it in the answer; ``recording`` is one of the dataset; ``effects`` are the suspects that are added
    to the rig; ``genes`` has the value of every gene by its name in the rig, in its unit, also of those effects.
    ``settings`` has settings that differ from those of the recording, ``input_factors`` what inputs are multiplied by;
    both are empty but where experiments are compared that were not recorded.
    """

    id: str
    recording: str
    effects: list[str]
    genes: dict[str, float]
    settings: dict[str, float]
    input_factors: dict[str, float]


class Work(TypedDict):
    """What a driver is to do for a job, and how far the job is.

    ``rig`` is the declaration of the rig, null unless it was wanted. ``simulations`` is empty where the job needs none
    at present; with a final ``state``, it needs no more.
    """

    job_id: str
    dataset_id: str
    state: State
    stage: str | None
    progress: float
    eta_seconds: float | None
    error: str | None
    rig: dict[str, Any] | None
    simulations: list[Simulation]


class Settled(TypedDict):
    """How many results were taken; ``unknown`` ones belong to simulations that the job no longer waits for."""

    taken: int
    unknown: int
