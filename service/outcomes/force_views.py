"""Forces from the inside to the wire and back: N to mN, radians to degrees; numbers that do not exist to null."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from wingfit.calibration.forces.estimation import Prediction
from wingfit.calibration.forces.result import (
    Agreement,
    ForceComparison,
    ForceResult,
    GlobalGene,
    GlobalModel,
    LocalEstimate,
    Quantity,
)
from wingfit.calibration.search import CalibrationSpec
from wingfit.records import Condition, Dataset, Recording
from wingfit.service.outcomes import force_schemas as schemas
from wingfit.service.outcomes.series import rounded
from wingfit.service.runs.schemas import ResultOut
from wingfit.service.runs.views import gene
from wingfit.service.units import PASCAL_PER_MBAR, ZERO_CELSIUS, finite, mn
from wingfit.sim.vehicle.terms import PRESETS, TERMS

Json = dict[str, Any]
Array = npt.NDArray[np.float64]
Matrix = tuple[tuple[float, ...], ...]

NORMAL_90 = 1.6448536269514722  # 90 of 100 draws of a normal distribution lie within so many standard deviations
MN2 = 1e6


def result(outcome: ForceResult, spec: CalibrationSpec, dataset: Dataset) -> schemas.ForceResultOut:
    """The outcome of a calibration on forces."""
    return schemas.ForceResultOut(
        kind="forces",
        before_mn=mn(outcome.before),
        after_mn=mn(outcome.after),
        held_out_before_mn=mn(outcome.held_out_before),
        held_out_after_mn=mn(outcome.held_out_after),
        remarks=list(outcome.remarks),
        genes=[gene(found) for found in outcome.genes],
        estimates=[_estimate(found, spec, dataset) for found in outcome.estimates],
        global_model=_law_out(outcome.global_model) if outcome.global_model else None,
        agreements=[schemas.AgreementOut.model_validate(agreement(found)) for found in outcome.agreements],
        left_out=[schemas.AgreementOut.model_validate(agreement(found)) for found in outcome.left_out],
        held_out=list(outcome.held_out),
    )


def stored(kind: str, result: Json) -> schemas.AnyResult:
    """The outcome of a calibration of either kind, as its row keeps it."""
    shape = ResultOut if kind == "tracks" else schemas.ForceResultOut
    return shape.model_validate({"kind": kind} | result)


def agreement(found: Agreement, source: str | None = None) -> Json:
    """How a model agrees with a recording; ``source`` in place of its own."""
    return {
        "recording": found.recording,
        "source": source or found.source,
        "quantity": found.quantity,
        "rmse_n": finite(found.rmse),
        "rmse_percent": finite(found.rmse_percent),
        "correlation": finite(found.correlation),
        "mean_recorded_n": finite(found.mean_recorded),
        "mean_modelled_n": finite(found.mean_modelled),
    }


def forces(found: ForceComparison, source: str | None = None) -> Json:
    """Forces as plain JSON (`force_schemas.ForcesOut`)."""
    return {
        "recording": found.recording,
        "source": source or found.source,
        "phase": np.round(found.phase, 9).tolist(),
        "recorded_n": _named(found.recorded),
        "spread_n": _named(found.spread),
        "modelled_n": _named(found.modelled),
        "frequency_hz": np.round(found.frequency, 6).tolist(),
        "recorded_spectrum_n2_hz": _named(found.recorded_spectrum, exact=True),
        "modelled_spectrum_n2_hz": _named(found.modelled_spectrum, exact=True),
        "remarks": list(found.remarks),
    }


def law(stored: Mapping[str, Any], dataset: Dataset) -> GlobalModel:
    """The global model of a stored result; its conditions are those of the recordings that it names."""
    return GlobalModel(
        genes=tuple(
            GlobalGene(
                name=one["name"],
                constant=one["constant"],
                per_hz=one["per_hz"],
                per_rad=math.degrees(one["per_deg"]),
                scatter=one["scatter"],
                largest_error=_part(one["largest_error_percent"], math.inf),
                left_out_error=_part(one["left_out_error_percent"], None),
            )
            for one in stored["genes"]
        ),
        recordings=tuple(stored["recordings"]),
        conditions=tuple(dataset.recording(name).condition for name in stored["recordings"]),
        remarks=tuple(stored["remarks"]),
    )


def condition(asked: schemas.PredictionIn) -> Condition:
    """A condition to predict, in SI."""
    return Condition(
        flap_frequency=asked.flap_frequency_hz,
        phase_lag=0.0,
        pressure=asked.pressure_mbar * PASCAL_PER_MBAR,
        temperature=asked.temperature_c + ZERO_CELSIUS,
        airspeed=asked.airspeed_m_s,
        angle_of_attack=math.radians(asked.body_pitch_deg),
    )


def prediction(found: Prediction) -> Json:
    """Predicted forces as plain JSON (`force_schemas.PredictionOut`)."""
    series = {f"{name}_n": rounded(values) for name, values in found.forces.items()}
    means = {name: float(found.forces[name].mean()) for name in ("lift", "drag")}
    return {
        "coefficients": dict(found.values),
        "phase": np.round(found.phase, 9).tolist(),
        **series,
        "averages_n": means,
        "warnings": list(found.remarks),
    }


def models() -> schemas.ModelsOut:
    """The presets and terms of the blade-element model."""
    presets = [
        schemas.PresetOut(name=p.name, terms=list(p.terms), source=p.source, description=p.description)
        for p in PRESETS.values()
    ]
    terms = [
        schemas.TermOut(
            name=term.name,
            genes=[
                schemas.TermGeneOut(
                    name=g.name, unit=g.unit, nominal=g.nominal, lower=g.lower, upper=g.upper, description=g.description
                )
                for g in term.genes
            ],
            equation=term.equation,
            source=term.source,
            description=term.description,
        )
        for term in TERMS.values()
    ]
    return schemas.ModelsOut(presets=presets, terms=terms)


def _estimate(found: LocalEstimate, spec: CalibrationSpec, dataset: Dataset) -> schemas.EstimateOut:
    recordings = dataset.select(found.recordings)
    noise = [_fitted(n, r, spec.axes) for n, r in zip(found.noise, recordings, strict=True)]
    return schemas.EstimateOut(
        name=found.name,
        recordings=list(found.recordings),
        coefficients=[_coefficient(name, value, found.standard_errors[name]) for name, value in found.values.items()],
        correlation=[[finite(value) for value in row] for row in found.correlation],
        noise_mn2=[[[finite(MN2 * value) for value in row] for row in matrix] for matrix in noise],
        cost=finite(found.cost),
        converged=found.converged,
        remarks=list(found.remarks),
    )


def _fitted(noise: Matrix, recording: Recording, axes: tuple[str, ...]) -> Matrix:
    """Rows and columns of a covariance of all channels that were fitted."""
    kept = [k for k, axis in enumerate(recording.forces) if axis in axes]
    return tuple(tuple(noise[i][j] for j in kept) for i in kept)


def _coefficient(name: str, value: float, error: float) -> schemas.CoefficientOut:
    half = NORMAL_90 * error
    return schemas.CoefficientOut(
        name=name,
        value=value,
        standard_error=finite(error),
        low_90=finite(value - half),
        high_90=finite(value + half),
    )


def _law_out(found: GlobalModel) -> schemas.GlobalModelOut:
    return schemas.GlobalModelOut(
        genes=[
            schemas.GlobalGeneOut(
                name=one.name,
                constant=one.constant,
                per_hz=one.per_hz,
                per_deg=math.radians(one.per_rad),
                scatter=one.scatter,
                largest_error_percent=finite(100 * one.largest_error),
                left_out_error_percent=None if one.left_out_error is None else finite(100 * one.left_out_error),
            )
            for one in found.genes
        ],
        recordings=list(found.recordings),
        frequency_range_hz=list(found.frequency_range),
        pitch_range_deg=[math.degrees(limit) for limit in found.pitch_range],
        airspeed_range_m_s=list(found.airspeed_range),
        remarks=list(found.remarks),
    )


def _part(percent: float | None, nothing: Any) -> Any:
    return nothing if percent is None else percent / 100


def _named(series: Mapping[Quantity, Array], *, exact: bool = False) -> Json:
    """Series by quantity, those that do not exist left out; ``exact`` keeps all digits."""
    plain = (lambda values: values.tolist()) if exact else rounded
    return {name: plain(values) for name, values in series.items() if np.isfinite(values).all()}
