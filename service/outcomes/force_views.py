"""Converts results of calibrations on forces to the API's JSON answers, and stored answers back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from wingfit.calibration.forces.estimation import Prediction
from wingfit.calibration.forces.result import (
    ForceComparison,
    ForceResult,
    GlobalGene,
    GlobalModel,
    LocalEstimate,
    Quantity,
)
from wingfit.calibration.search import CalibrationSpec
from wingfit.client import force_answers as f
from wingfit.client.answers import Result
from wingfit.client.series_answers import SeriesResult
from wingfit.records import Condition, Dataset, Recording
from wingfit.service.answers import answer, checked, in_si
from wingfit.service.outcomes.requests import PredictionIn
from wingfit.service.outcomes.series import rounded
from wingfit.service.runs.views import gene
from wingfit.service.units import finite
from wingfit.sim.vehicle.terms import PRESETS, TERMS

Json = dict[str, Any]
Array = npt.NDArray[np.float64]
Matrix = tuple[tuple[float, ...], ...]

NORMAL_90 = 1.6448536269514722  # standard deviations on either side of the mean that hold 90 % of a normal distribution
MN2 = 1e6


def result(outcome: ForceResult, spec: CalibrationSpec, dataset: Dataset) -> f.ForceResult:
    """Return the JSON answer with the result of a calibration on forces."""
    model = outcome.global_model
    return answer(
        f.ForceResult,
        outcome,
        kind="forces",
        genes=[gene(one) for one in outcome.genes],
        estimates=[_estimate(one, spec, dataset) for one in outcome.estimates],
        leave_one_out=[answer(f.Agreement, one) for one in outcome.left_out],
        global_model=model and answer(f.GlobalModel, model, genes=[_global_gene(one) for one in model.genes]),
    )


def stored(kind: str, result: Json) -> Result | f.ForceResult | SeriesResult:
    """Return the JSON answer for ``result``, as stored in the database; ``kind``: tracks, forces or series."""
    whole = {"kind": kind} | result
    if kind == "series":
        return checked(SeriesResult, whole)
    return checked(Result, whole) if kind == "tracks" else checked(f.ForceResult, whole)


def forces(found: ForceComparison, source: f.SourceOrGiven | None = None) -> f.Forces:
    """Return recorded and modelled forces over the beat as the JSON answer; ``source``, if any, replaces its source."""
    return {
        "recording": found.recording,
        "source": source or found.source,
        "phase": np.round(found.phase, 9).tolist(),
        "recorded_n": _named(found.recorded),
        "standard_deviation_n": _named(found.spread),
        "modelled_n": _named(found.modelled),
        "frequency_hz": np.round(found.frequency, 6).tolist(),
        "recorded_spectrum_n2_hz": _named(found.recorded_spectrum, exact=True),
        "modelled_spectrum_n2_hz": _named(found.modelled_spectrum, exact=True),
        "remarks": list(found.remarks),
    }


def law(stored: f.GlobalModel, dataset: Dataset) -> GlobalModel:
    """Convert ``stored``, a global model as JSON, back; its conditions are those of the recordings that it names."""
    return GlobalModel(
        genes=tuple(
            GlobalGene(
                name=one["name"],
                constant=one["constant"],
                per_hz=one["per_hz"],
                per_rad=math.degrees(one["per_deg"]),
                scatter=one["scatter"],
                largest_error=_fraction(one["largest_error_percent"], math.inf),
                left_out_error=_fraction(one["leave_one_out_error_percent"], None),
            )
            for one in stored["genes"]
        ),
        recordings=tuple(stored["recordings"]),
        conditions=tuple(dataset.recording(name).condition for name in stored["recordings"]),
        remarks=tuple(stored["remarks"]),
    )


def condition(requested: PredictionIn) -> Condition:
    """Return the condition of a requested prediction, in SI units."""
    values = in_si(requested.model_dump())
    return Condition(phase_lag=0.0, angle_of_attack=values.pop("body_pitch"), **values)


def prediction(found: Prediction) -> f.Prediction:
    """Return predicted forces over the beat as the JSON answer."""
    return {
        "coefficients": dict(found.values),
        "phase": np.round(found.phase, 9).tolist(),
        "x_n": rounded(found.forces["x"]),
        "z_n": rounded(found.forces["z"]),
        "lift_n": rounded(found.forces["lift"]),
        "drag_n": rounded(found.forces["drag"]),
        "averages_n": {"lift": float(found.forces["lift"].mean()), "drag": float(found.forces["drag"].mean())},
        "warnings": list(found.remarks),
    }


def models() -> f.Models:
    """Return the presets and the terms of the blade-element model as the JSON answer."""
    return {
        "presets": [answer(f.Preset, preset) for preset in PRESETS.values()],
        "terms": [answer(f.Term, term) for term in TERMS.values()],
    }


def _estimate(found: LocalEstimate, spec: CalibrationSpec, dataset: Dataset) -> f.Estimate:
    recordings = dataset.select(found.recordings)
    noise = [_fitted(n, r, spec.axes) for n, r in zip(found.noise, recordings, strict=True)]
    return answer(
        f.Estimate,
        found,
        coefficients=[_coefficient(name, value, found.standard_errors[name]) for name, value in found.values.items()],
        negative_log_likelihood=finite(found.cost),
        noise_mn2=[[[finite(MN2 * value) for value in row] for row in matrix] for matrix in noise],
    )


def _fitted(noise: Matrix, recording: Recording, axes: tuple[str, ...]) -> Matrix:
    """Return the part of ``noise``, the covariance of all force channels of ``recording``, for the fitted ``axes``."""
    fitted = [k for k, axis in enumerate(recording.forces) if axis in axes]
    return tuple(tuple(noise[i][j] for j in fitted) for i in fitted)


def _coefficient(name: str, value: float, error: float) -> f.Coefficient:
    half = NORMAL_90 * error
    low, high = finite(value - half), finite(value + half)
    return {"name": name, "value": value, "standard_error": finite(error), "low_90": low, "high_90": high}


def _global_gene(one: GlobalGene) -> f.GlobalGene:
    error = one.left_out_error
    percent = None if error is None else finite(100 * error)
    return answer(f.GlobalGene, one, per_deg=math.radians(one.per_rad), leave_one_out_error_percent=percent)


def _fraction(percent: float | None, nothing: Any) -> Any:
    return nothing if percent is None else percent / 100


def _named(series: Mapping[Quantity, Array], *, exact: bool = False) -> f.ByQuantity:
    """Return each series as a list, rounded unless ``exact``; series that contain infinity or NaN are omitted."""
    plain = (lambda values: values.tolist()) if exact else rounded
    return {name: plain(values) for name, values in series.items() if np.isfinite(values).all()}
