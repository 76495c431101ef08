"""JSON answers of the server about forces: forces in N, misfits in mN, angles in degrees."""

from __future__ import annotations

from typing import Annotated, Literal, NotRequired

from annotated_types import Len
from typing_extensions import TypedDict

from wingfit.client.answers import GeneInfo

Source = Literal["nominal", "local", "joint", "global", "average"]
# Where the coefficients come from: an estimate of a run, or the genome given in a request.
SourceOrGiven = Literal["nominal", "local", "joint", "global", "average", "given"]
Quantity = Literal["lift", "drag", "x", "z"]
Series = list[float]
Pair = Annotated[list[float], Len(2, 2)]
# A series over the beat for each force; lift and drag are present only if both axes were recorded.
ByQuantity = dict[Quantity, Series]


class Coefficient(TypedDict):
    """A coefficient of the force model with its standard error (Cramer-Rao bound), in the unit of the coefficient.

    ``low_90`` and ``high_90`` are the ends of the 90 % confidence interval. With fewer than 24 beats in a recording,
    the interval contains the true value in fewer than 90 % of cases. Null: not known.
    """

    name: str
    value: float
    standard_error: float | None
    low_90: float | None
    high_90: float | None


class Estimate(TypedDict):
    """Maximum-likelihood estimate of the coefficients from one recording, or from several together.

    ``correlation`` is the correlation matrix of the estimation errors, in the order of ``coefficients``; ``noise_mn2``
    holds, for each recording, the covariance matrix of the noise on the fitted force axes, mN^2.
    ``negative_log_likelihood`` omits the constant term; ``converged``: whether the iteration did.
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
    """A coefficient as a function of the condition: constant + per_hz x flap frequency + per_deg x body pitch.

    ``scatter``: standard deviation of the single recordings' estimates about this function, beyond their own errors.
    The errors in percent are the largest differences from these estimates, when fitted or when left out of the fit.
    """

    name: str
    constant: float
    per_hz: float
    per_deg: float
    scatter: float | None
    largest_error_percent: float | None
    leave_one_out_error_percent: float | None


class GlobalModel(TypedDict):
    """Coefficients as functions of flap frequency and body pitch, with the ranges of the fitted conditions."""

    genes: list[GlobalGene]
    recordings: list[str]
    frequency_range_hz: Pair
    pitch_range_deg: Pair
    airspeed_range_m_s: Pair
    remarks: list[str]


class Agreement(TypedDict):
    """Agreement between modelled and recorded force over the mean beat, for one recording and one ``quantity``.

    ``source`` says from which estimate the model has its coefficients. ``rmse_n`` is the RMS difference,
    ``rmse_percent`` the same in percent of the range of the recorded force; it and ``correlation`` are null for a
    constant force. ``mean_..._n`` are means over the beat.
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
    """Result of a calibration on forces.

    ``before_mn`` (nominal coefficients) and ``after_mn`` (estimated ones) are RMS differences between modelled and
    recorded forces on the fitted axes. ``agreements`` compare each recording with the model for every source of
    coefficients; in ``leave_one_out`` the global model was fitted without the recording that it predicts. ``noise_mn``
    is the RMS of what differs from beat to beat on these axes; null with too few beats, and in results of before.
    """

    kind: Literal["forces"]
    before_mn: float | None
    after_mn: float | None
    held_out_before_mn: float | None
    held_out_after_mn: float | None
    noise_mn: NotRequired[float | None]
    remarks: list[str]
    genes: list[GeneInfo]
    estimates: list[Estimate]
    global_model: GlobalModel | None
    agreements: list[Agreement]
    leave_one_out: list[Agreement]
    held_out: list[str]


class Forces(TypedDict):
    """Forces over the beat and their spectra: recorded (mean beat, standard deviation between beats) and modelled.

    ``phase`` is t* (fraction of the beat), 0 where the wings are closest; forces are given at each ``phase``.
    ``source`` says from which estimate the model has its coefficients. ``standard_deviation_n`` is empty with a single
    beat. Spectra are one-sided power spectral densities at each ``frequency_hz``, empty if the recording has no piece
    without gaps.
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
    """Forces over the beat, modelled with the genome of a request, and their agreement with the recording."""

    agreements: list[Agreement]


class Prediction(TypedDict):
    """Unfiltered forces that a global model predicts at each ``phase`` (fraction of the beat), and their averages.

    ``warnings`` say in which respect the model extrapolates.
    """

    coefficients: dict[str, float]
    phase: Series
    x_n: Series
    z_n: Series
    lift_n: Series
    drag_n: Series
    averages_n: dict[Literal["lift", "drag"], float]
    warnings: list[str]


class TermGene(TypedDict):
    """A coefficient of a term, with its bounds ``lower`` and ``upper``; ``nominal``: its value unless estimated."""

    name: str
    unit: str
    nominal: float
    lower: float
    upper: float
    description: str


class Term(TypedDict):
    """One physical term of the quasi-steady force on a wing, with its coefficients; ``source`` is its publication."""

    name: str
    genes: list[TermGene]
    equation: str
    source: str
    description: str


class Preset(TypedDict):
    """A published blade-element model: the names of the ``terms`` that it contains, and its publication."""

    name: str
    terms: list[str]
    source: str
    description: str


class Models(TypedDict):
    """Blade-element models of vehicles: presets, and the terms of which they consist."""

    presets: list[Preset]
    terms: list[Term]
