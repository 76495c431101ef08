"""JSON answers of the server about diagnoses."""

from __future__ import annotations

from typing import Literal

from typing_extensions import TypedDict

from wingfit.client.answers import Job, JobSpec

Verdict = Literal["adequate", "named", "partly named", "ambiguous", "unnamed", "measurement fault"]


class DiagnosisSpec(JobSpec):
    """The settings of a diagnosis.

    ``fixed``: values of genes that are not estimated; ``suspects``: names of the effects to be tested as explanations
    (empty: all that apply); ``refine``: allow a finer discretisation of the wing; ``refits``: largest number of effects
    refitted in full; ``exhaustive``: every pair of the suspects is fitted; ``start``: the initial genome, empty for the
    nominal values in the dataset.
    """

    fixed: dict[str, float]
    suspects: list[str]
    refine: bool
    refits: int
    exhaustive: bool
    start: dict[str, float]


class Diagnosis(Job):
    """A diagnosis, which identifies the physics missing from a model.

    ``run_id`` is the run from which it started, else null; ``pending_action`` a cancellation that has not taken effect
    yet; ``steps`` counts its progress reports. ``verdict`` and ``summary`` are null until it has succeeded.
    """

    run_id: str | None
    spec: DiagnosisSpec
    pending_action: Literal["CANCEL"] | None
    steps: int
    verdict: Verdict | None
    summary: str | None


class PlaceMisfit(TypedDict):
    """Misfit of the nominal model at a marker, in a force axis or in a channel, in ``unit``, noise subtracted.

    ``x`` and ``y``: its place on the wing in m; null without one.
    """

    name: str
    unit: str
    misfit: float
    x: float | None
    y: float | None


class Lead(TypedDict):
    """Effects that may be missing, and the fraction of the misfit beyond the noise that they explain.

    ``refitted``: they were added to the model and fitted; else a score test predicts the fraction.
    """

    effects: list[str]
    title: str
    explained: float
    refitted: bool


class PartialFinding(TypedDict):
    """What a running diagnosis knows so far; it can still change, and gives no probabilities.

    ``noise`` and ``misfit`` of the nominal model are root mean squares in ``unit`` (m, N, or 1 for series); ``places``
    say where it lies; ``outline`` of the wing in m; ``tested`` of ``suspects`` effects were score-tested.
    """

    unit: Literal["m", "N", "1"]
    noise: float
    misfit: float
    places: list[PlaceMisfit]
    outline: list[tuple[float, float]]
    leads: list[Lead]
    tested: int
    suspects: int


class StepEvent(TypedDict):
    """The data of the server-sent event ``step``, a report on the progress of a diagnosis.

    ``stage`` says what is computed; ``evaluations`` (simulated individuals) and ``elapsed_seconds`` count from the last
    start of the diagnosis, which starts again if the server restarts; ``progress`` lies in [0, 1].
    """

    sequence: int
    stage: str
    progress: float
    evaluations: int
    elapsed_seconds: float
    eta_seconds: float | None
