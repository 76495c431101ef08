"""JSON answers of the server about forces: forces in N, misfits in mN, angles in degrees."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Len
from typing_extensions import TypedDict

from wingfit.client.answers import GeneInfo

Source = Literal["nominal", "local", "joint", "global", "average"]
# Of the coefficients: those of a run, or the genome given in a request.
SourceOrGiven = Literal["nominal", "local", "joint", "global", "average", "given"]
Quantity = Literal["lift", "drag", "x", "z"]
Series = list[float]
Pair = Annotated[list[float], Len(2, 2)]
# Lift and drag are present where both axes were recorded.
ByQuantity = dict[Quantity, Series]


class Coefficient(TypedDict):
    """A coefficient with its standard error (Cramer-Rao bound) and 90 % confidence interval.

    The true coverage is below 90 % where a recording has fewer than 24 beats.
    """

    name: str
    value: float
    standard_error: float | None
    low_90: float | None
    high_90: float | None


class Estimate(TypedDict):
    """Maximum-likelihood estimate on one recording, or on several together.

    ``correlation`` is in the order of the coefficients; ``noise_mn2`` is the covariance of the fitted outputs, one
    matrix per recording. The log-likelihood lacks its constant term.
    """

    name: str
    recordings: list[str]
    coefficients: list[Coefficient]
    correlation: list[list[float | None]]
    noise_mn2: list[list[list[float | None]]]
    negative_log_likelihood: float | None
    converged: bool
    remarks: list[str]


class GlobalGene(TypedDict):
    """A coefficient over the conditions: constant + per_hz x flap frequency + per_deg x body pitch."""

    name: str
    constant: float
    per_hz: float
    per_deg: float
    scatter: float | None
    largest_error_percent: float | None
    leave_one_out_error_percent: float | None


class GlobalModel(TypedDict):
    """Coefficients as functions of the condition, and the range of conditions to which they were fitted."""

    genes: list[GlobalGene]
    recordings: list[str]
    frequency_range_hz: Pair
    pitch_range_deg: Pair
    airspeed_range_m_s: Pair
    remarks: list[str]


class Agreement(TypedDict):
    """Agreement of a model with a recording in one quantity; percentages refer to the range of the recorded mean beat.

    Percentage and correlation are null for a constant force.
    """

    recording: str
    source: SourceOrGiven
    quantity: Quantity
    rmse_n: float | None
    rmse_percent: float | None
    correlation: float | None
    mean_recorded_n: float | None
    mean_modelled_n: float | None


class ForceResult(TypedDict):
    """Result of a calibration on forces; RMS differences of the fitted axes, nominal and calibrated.

    ``agreements`` compare each recording with every model; for ``leave_one_out`` the global model was fitted without
    the recording that it predicts.
    """

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
    leave_one_out: list[Agreement]
    held_out: list[str]


class Forces(TypedDict):
    """Forces over the beat and their spectra: recorded (mean beat, standard deviation between beats) and modelled.

    ``phase`` is t* (fraction of the beat), 0 where the wings are closest. ``standard_deviation_n`` is empty with a
    single beat; the spectra are empty where the recording has no piece without gaps.
    """

    recording: str
    source: SourceOrGiven
    phase: Series
    recorded_n: ByQuantity
    standard_deviation_n: ByQuantity
    modelled_n: ByQuantity
    frequency_hz: Series
    recorded_spectrum_n2_hz: ByQuantity
    modelled_spectrum_n2_hz: ByQuantity
    remarks: list[str]


class ForceSimulation(Forces):
    """Forces over the beat with the genome of a request, and their agreement in every quantity."""

    agreements: list[Agreement]


class Prediction(TypedDict):
    """Unfiltered forces over one beat that a global model predicts; ``warnings`` say where it extrapolates."""

    coefficients: dict[str, float]
    phase: Series
    x_n: Series
    z_n: Series
    lift_n: Series
    drag_n: Series
    averages_n: dict[Literal["lift", "drag"], float]
    warnings: list[str]


class TermGene(TypedDict):
    """A coefficient of a term, its range, and its value where it is not estimated."""

    name: str
    unit: str
    nominal: float
    lower: float
    upper: float
    description: str


class Term(TypedDict):
    """One physical term of the quasi-steady force, and its source."""

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
    """Models of vehicles: presets, and the terms of which they consist."""

    presets: list[Preset]
    terms: list[Term]
