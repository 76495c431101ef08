"""Shapes of the server's answers about forces, as the Python client hands them out (docs/api.md)."""

from __future__ import annotations

from typing import Literal, TypedDict

from wingfit.client.answers import GeneInfo

Source = Literal["nominal", "local", "joint", "global", "average"]
ByQuantity = dict[str, list[float]]


class Coefficient(TypedDict):
    """A coefficient with its standard error and an interval that holds it in about 90 of 100 cases."""

    name: str
    value: float
    standard_error: float | None
    low_90: float | None
    high_90: float | None


class Estimate(TypedDict):
    """Estimate on one recording, or on several together; ``noise_mn2`` per recording, of the fitted axes."""

    name: str
    recordings: list[str]
    coefficients: list[Coefficient]
    correlation: list[list[float | None]]
    noise_mn2: list[list[list[float | None]]]
    cost: float | None
    converged: bool
    remarks: list[str]


class GlobalGene(TypedDict):
    """constant + per_hz x flap frequency + per_deg x body pitch."""

    name: str
    constant: float
    per_hz: float
    per_deg: float
    scatter: float | None
    largest_error_percent: float | None
    left_out_error_percent: float | None


class GlobalModel(TypedDict):
    """Coefficients as functions of the condition, and where they were fitted."""

    genes: list[GlobalGene]
    recordings: list[str]
    frequency_range_hz: list[float]
    pitch_range_deg: list[float]
    airspeed_range_m_s: list[float]
    remarks: list[str]


class Agreement(TypedDict):
    """How a model agrees with a recording in one quantity: lift, drag, x or z."""

    recording: str
    source: Literal["nominal", "local", "joint", "global", "average", "given"]
    quantity: str
    rmse_n: float | None
    rmse_percent: float | None
    correlation: float | None
    mean_recorded_n: float | None
    mean_modelled_n: float | None


class ForceResult(TypedDict):
    """Outcome of a finished run on forces."""

    kind: Literal["forces"]
    before_mn: float | None
    after_mn: float | None
    held_out_before_mn: float | None
    held_out_after_mn: float | None
    remarks: list[str]
    genes: list[GeneInfo]
    estimates: list[Estimate]
    global_model: GlobalModel | None
    agreements: list[Agreement]
    left_out: list[Agreement]
    held_out: list[str]


class Forces(TypedDict):
    """Recorded and modelled forces over the beat, and their spectra, by quantity."""

    recording: str
    source: str
    phase: list[float]
    recorded_n: ByQuantity
    spread_n: ByQuantity
    modelled_n: ByQuantity
    frequency_hz: list[float]
    recorded_spectrum_n2_hz: ByQuantity
    modelled_spectrum_n2_hz: ByQuantity
    remarks: list[str]


class ForceSimulation(Forces):
    """Forces of a genome of one's own, with their agreement in every quantity."""

    agreements: list[Agreement]


class Prediction(TypedDict):
    """Forces over one beat that a global model predicts for a condition."""

    coefficients: dict[str, float]
    phase: list[float]
    x_n: list[float]
    z_n: list[float]
    lift_n: list[float]
    drag_n: list[float]
    averages_n: dict[str, float]
    warnings: list[str]


class TermGene(TypedDict):
    """A coefficient of a term."""

    name: str
    unit: str
    nominal: float
    lower: float
    upper: float
    description: str


class Term(TypedDict):
    """One physical term of the quasi-steady force."""

    name: str
    genes: list[TermGene]
    equation: str
    source: str
    description: str


class Preset(TypedDict):
    """A published model: names of its terms."""

    name: str
    terms: list[str]
    source: str
    description: str


class Models(TypedDict):
    """Models of vehicles: presets, and the terms that they are made of."""

    presets: list[Preset]
    terms: list[Term]
