"""What comes out of calibrations on forces, on the wire: forces in N, misfits in mN, angles in degrees."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from wingfit.service.outcomes.load_schemas import Number
from wingfit.service.runs.schemas import GeneOut, ResultOut

Source = Literal["nominal", "local", "joint", "global", "average"]
Quantity = Literal["lift", "drag", "x", "z"]
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
Series = list[float]
# Lift and drag are there where both axes were recorded.
ByQuantity = dict[Quantity, Series]


class CoefficientOut(BaseModel):
    """A coefficient with its standard error (Cramer-Rao bound) and an interval that holds it in about 90 of 100 cases.

    In as many only with beats enough, 24 or more: fewer tell their own scatter badly.
    """

    name: str
    value: float
    standard_error: float | None
    low_90: float | None
    high_90: float | None


class EstimateOut(BaseModel):
    """Maximum-likelihood estimate on one recording, or on several together.

    ``correlation`` is in the order of the coefficients; ``noise_mn2`` the covariance of the fitted outputs, a matrix
    for each recording. ``cost`` is minus the logarithm of the likelihood, less what is constant.
    """

    name: str
    recordings: list[str]
    coefficients: list[CoefficientOut]
    correlation: list[list[float | None]]
    noise_mn2: list[list[list[float | None]]]
    cost: float | None
    converged: bool
    remarks: list[str]


class GlobalGeneOut(BaseModel):
    """A coefficient over the conditions: constant + per_hz x flap frequency + per_deg x body pitch."""

    name: str
    constant: float
    per_hz: float
    per_deg: float
    scatter: float | None
    largest_error_percent: float | None
    left_out_error_percent: float | None


class GlobalModelOut(BaseModel):
    """Coefficients as functions of the condition, and where they were fitted."""

    genes: list[GlobalGeneOut]
    recordings: list[str]
    frequency_range_hz: Pair
    pitch_range_deg: Pair
    airspeed_range_m_s: Pair
    remarks: list[str]


class AgreementOut(BaseModel):
    """How a model agrees with a recording in one quantity; per cent are of the range of the recorded mean beat.

    Of a constant force there is neither a percentage nor a correlation.
    """

    recording: str
    source: Literal["nominal", "local", "joint", "global", "average", "given"]
    quantity: Quantity
    rmse_n: float | None
    rmse_percent: float | None
    correlation: float | None
    mean_recorded_n: float | None
    mean_modelled_n: float | None


class ForceResultOut(BaseModel):
    """Outcome of a calibration on forces; RMS differences of the fitted axes, nominal and calibrated.

    ``agreements`` compare each recording with every model that there is; in ``left_out`` the global model was fitted
    without the recording that it predicts.
    """

    kind: Literal["forces"]
    before_mn: float | None
    after_mn: float | None
    held_out_before_mn: float | None
    held_out_after_mn: float | None
    remarks: list[str]
    genes: list[GeneOut]
    estimates: list[EstimateOut]
    global_model: GlobalModelOut | None
    agreements: list[AgreementOut]
    left_out: list[AgreementOut]
    held_out: list[str]


AnyResult = Annotated[ResultOut | ForceResultOut, Field(discriminator="kind")]


class BeatOut(BaseModel):
    """Recorded mean beat (with the standard deviation between beats) and modelled one, and their spectra.

    ``phase`` is t*: 0 where the wings are closest. ``spread_n`` is empty with a single beat, spectra with no gapless
    piece of the recording.
    """

    recording: str
    phase: Series
    recorded_n: ByQuantity
    spread_n: ByQuantity
    modelled_n: ByQuantity
    frequency_hz: Series
    recorded_spectrum_n2_hz: ByQuantity
    modelled_spectrum_n2_hz: ByQuantity
    remarks: list[str]


class ForcesOut(BeatOut):
    """A beat of a run's coefficients, from ``source``."""

    source: Source


class ForceSimulationOut(BeatOut):
    """A genome of the caller's beside a recording, with its agreement in every quantity."""

    source: Literal["given"]
    agreements: list[AgreementOut]


class PredictionIn(BaseModel):
    """A condition in which to predict forces; limits as in `dataset.yaml`."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={"examples": [{"flap_frequency_hz": 12.0, "body_pitch_deg": 60.0, "airspeed_m_s": 0.7}]},
    )

    flap_frequency_hz: Annotated[Number, Field(ge=0.01, le=1000)]
    body_pitch_deg: Annotated[Number, Field(ge=-90, le=90)]
    airspeed_m_s: Annotated[Number, Field(ge=0, le=100)]
    pressure_mbar: Annotated[Number, Field(ge=0, le=20_000)] = 1013.25
    temperature_c: Annotated[Number, Field(ge=-100, le=100)] = 20.0


class LiftDragOut(BaseModel):
    """Means over the beat."""

    lift: float
    drag: float


class PredictionOut(BaseModel):
    """Forces over one beat, unfiltered, from the coefficients that the global model gives for the condition.

    ``warnings`` say where it extrapolates.
    """

    coefficients: dict[str, float]
    phase: Series
    x_n: Series
    z_n: Series
    lift_n: Series
    drag_n: Series
    averages_n: LiftDragOut
    warnings: list[str]


class TermGeneOut(BaseModel):
    """A coefficient of a term, with its range and the value that it has where it is not estimated."""

    name: str
    unit: str
    nominal: float
    lower: float
    upper: float
    description: str


class TermOut(BaseModel):
    """One physical term of the quasi-steady force, and where it stands in print."""

    name: str
    genes: list[TermGeneOut]
    equation: str
    source: str
    description: str


class PresetOut(BaseModel):
    """A published model: names of its terms."""

    name: str
    terms: list[str]
    source: str
    description: str


class ModelsOut(BaseModel):
    """Models of vehicles: presets, and the terms that they are made of."""

    presets: list[PresetOut]
    terms: list[TermOut]
