"""The JSON answer of the server to a request for a plan; :mod:`wingfit.planning.outcome` explains its fields."""

from __future__ import annotations

from typing_extensions import TypedDict


class PlannedNoise(TypedDict):
    """The noise that was assumed, in ``unit``; ``source``: "stated", "recordings" or "default"."""

    unit: str
    deviation: dict[str, float]
    correlation: float
    scatter_percent: float | None
    source: str


class PlannedGene(TypedDict):
    """How well a gene will be known; ``beats_for_target`` null: no number of beats is enough."""

    name: str
    unit: str
    value: float
    standard_error: float
    relative_percent: float
    identified: bool
    beats_for_target: int | None
    alone_percent: float
    correlated_with: str | None
    correlation: float


class PlannedSize(TypedDict):
    """A size of an effect: its typical value, and the smallest that will be detected."""

    name: str
    unit: str
    typical: float
    smallest: float | None


class PlannedEffect(TypedDict):
    """Whether an effect will be detected, from which size, and which other effect resembles it most.

    Parts are sizes divided by the typical one: detected with the stated power, evidence in a diagnosis, and
    distinguished from the rival.
    """

    name: str
    title: str
    family: str
    sizes: list[PlannedSize]
    detection_probability: float
    smallest_part: float | None
    diagnosed_part: float | None
    explained_percent: float
    rival: str | None
    cosine: float
    separable_part: float | None


class ConfusedPair(TypedDict):
    """Two effects that these recordings do not distinguish at typical sizes."""

    one: str
    other: str
    cosine: float
    probability: float


class Proposal(TypedDict):
    """A further recording; factors are those with all proposals up to this one."""

    words: str
    condition: dict[str, float]
    repeats: str | None
    beyond: list[str]
    standard_error_factor: float
    separation_factor: float


class PlanVariant(TypedDict):
    """The same recordings with other numbers of beats, frames or markers."""

    what: str
    number: int
    standard_error_factor: float
    identified: int


class Plan(TypedDict):
    """What a campaign will show: genes, effects, and the recordings that add most."""

    dataset: str
    kind: str
    recordings: list[str]
    seconds: float
    beats: float
    frames: float
    markers: int
    noise: PlannedNoise
    power: float
    false_alarm: float
    odds: float
    target_percent: float
    genes: list[PlannedGene]
    effects: list[PlannedEffect]
    confused: list[ConfusedPair]
    for_genes: list[Proposal]
    for_effects: list[Proposal]
    variants: list[PlanVariant]
    remarks: list[str]
