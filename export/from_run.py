"""Make a calibrated model of a run: its settings, its dataset, and its stored result."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy

from wingfit.calibration.effects import is_measured
from wingfit.calibration.forces.result import GlobalGene, GlobalModel
from wingfit.calibration.problem import base_genome
from wingfit.calibration.spec import CalibrationSpec, model_for
from wingfit.export.calibrated_model import (
    CalibratedModel,
    Covariance,
    FittedRange,
    FittedRecording,
    Parameter,
    Provenance,
)
from wingfit.export.runtime.parts import CONDITION_UNITS
from wingfit.records import Dataset, Gene, Recording
from wingfit.records.array_types import Array
from wingfit.sim.effects.registry import EFFECTS

Json = Mapping[str, Any]
NO_COVARIANCE = (
    "predictions have no intervals: the stored result has no covariance of the parameters; results of earlier versions "
    "do not keep it: calibrate or diagnose again"
)


def of_tracks(
    spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float], result: Json, provenance: Provenance
) -> CalibratedModel:
    """Return the model of a run on tracks, with the best ``genome`` (all genes by name) and the stored ``result``."""
    names = {one["name"] for one in result["recordings"] if one["stage"] is not None}
    known = result.get("covariance")
    searched = {one["name"] for one in result["genes"] if one["searched"]}
    return assembled(
        dataset,
        spec,
        genome,
        searched,
        covariance=covariance_of(known["names"], known["matrix"]) if known else None,
        misfit=(_scaled(result["after_mm"]), _scaled(result["noise_mm"]), "m"),
        fitted=[one for one in dataset.recordings if one.name in names],
        provenance=replace(provenance, source="best genome of the calibration"),
        remarks=result["remarks"],
    )


def of_forces(
    spec: CalibrationSpec, dataset: Dataset, result: Json, law: GlobalModel | None, provenance: Provenance
) -> CalibratedModel:
    """Return the model of a run on forces, with the stored ``result`` and its global model ``law``, if it has one.

    Without a global model it is the estimate on all recordings together or, of local estimates, their average.
    """
    estimates = result["estimates"]
    names = [name for one in estimates for name in one["recordings"]]
    fitted = [one for one in dataset.recordings if one.name in names]
    free = [one["name"] for one in estimates[0]["coefficients"]]
    genome = {**_nominal(dataset, spec), **{one["name"]: one["best"] for one in result["genes"]}}
    laws, source, covariance = dict[str, GlobalGene](), "", None
    if law is not None:
        law = _with_scatter(law, estimates)
        laws = {one.name: one for one in law.genes}
        genome |= {one.name: one.constant for one in law.genes}
        source = f"global model of {len(names)} recordings (Armanini et al. 2016, Eq. 23)"
        covariance = _of_law(law, estimates)
    elif len(estimates) == 1:
        source = f"estimate on {', '.join(estimates[0]['recordings'])}"
        covariance = _of_estimate(estimates[0])
    else:
        source, covariance = f"average of the estimates on {len(estimates)} recordings", _of_average(estimates, free)
    return assembled(
        dataset,
        spec,
        genome,
        set(free),
        covariance=covariance,
        misfit=(_scaled(result["after_mn"]), _scaled(result.get("noise_mn")), "N"),
        fitted=fitted,
        provenance=replace(provenance, source=source),
        remarks=result["remarks"],
        laws=laws,
    )


def assembled(
    dataset: Dataset,
    spec: CalibrationSpec,
    genome: Mapping[str, float],
    estimated: set[str],
    *,
    covariance: Covariance | None,
    misfit: tuple[float | None, float | None, str],
    fitted: Sequence[Recording],
    provenance: Provenance,
    remarks: Sequence[str],
    laws: Mapping[str, GlobalGene] | None = None,
) -> CalibratedModel:
    """Return the model of ``dataset`` with the settings ``spec`` and the values ``genome`` (by name), as it is.

    Effects of the measurement are removed. ``misfit``: that of the fit, the noise, and their unit.
    """
    kept = tuple(name for name in spec.effects if EFFECTS[name].family != "measurement")
    removed = [name for name in spec.effects if name not in kept]
    settings = replace(spec, effects=kept, fixed={}, search_division=None, recordings=(), genes=())
    genes = model_for(dataset, settings).genes
    values = {gene.name: genome.get(gene.name, gene.nominal) for gene in genes}
    own = tuple(_parameter(gene, values[gene.name], gene.name in estimated, laws or {}) for gene in genes)
    return CalibratedModel(
        kind=dataset.kind,
        rig=dataset.rig,
        settings=settings,
        parameters=own,
        covariance=_without_faults(covariance),
        misfit=misfit[0],
        noise=misfit[1],
        misfit_unit=misfit[2],
        ranges=ranges(fitted),
        recordings=tuple(FittedRecording(one.name, one.condition) for one in fitted),
        provenance=provenance,
        remarks=(*remarks, *_said(removed, covariance, fitted)),
    )


def ranges(fitted: Sequence[Recording]) -> tuple[FittedRange, ...]:
    """Return the range of every field of the conditions of ``fitted``."""
    found = []
    for name, unit in CONDITION_UNITS.items():
        values = [getattr(one.condition, name) for one in fitted]
        found.append(FittedRange(name, unit, min(values), max(values)))
    return tuple(found)


def covariance_of(names: Sequence[str], matrix: Any) -> Covariance | None:
    """Return the covariance of the estimates ``names``; None if there is none, or if it is not finite."""
    table = np.asarray(matrix, float)
    if not len(names) or table.shape != (len(names), len(names)) or not np.isfinite(table).all():
        return None
    return Covariance(tuple(names), tuple(tuple(row) for row in table.tolist()))


def _parameter(gene: Gene, value: float, estimated: bool, laws: Mapping[str, GlobalGene]) -> Parameter:
    law = laws.get(gene.name)
    slopes = (law.per_hz, law.per_rad, law.scatter or 0.0) if law else (0.0, 0.0, 0.0)
    return Parameter(gene.name, gene.unit, gene.description, value, gene.lower, gene.upper, estimated, *slopes)


def _said(removed: Sequence[str], covariance: Covariance | None, fitted: Sequence[Recording]) -> list[str]:
    found = []
    if removed:
        found.append(f"faults of the measurement are not part of the model: {', '.join(removed)}")
    if covariance is None:
        found.append(NO_COVARIANCE)
    if own := [one.name for one in fitted if one.motion is not None]:
        found.append(f"the model moves its wings as the vehicle describes, and not as recorded in {', '.join(own)}")
    return found


def _without_faults(known: Covariance | None) -> Covariance | None:
    """Return ``known`` without faults of the measurement, on which a prediction does not depend."""
    if known is None:
        return None
    rows = [k for k, name in enumerate(known.names) if not is_measured(name)]
    return covariance_of([known.names[k] for k in rows], np.array(known.matrix)[np.ix_(rows, rows)])


def _nominal(dataset: Dataset, spec: CalibrationSpec) -> dict[str, float]:
    return base_genome(model_for(dataset, spec), spec.fixed).as_dict()


def _scaled(value: float | None) -> float | None:
    """Return ``value`` (mm or mN) in m or N."""
    return None if value is None else value / 1e3


def _errors(estimate: Json) -> dict[str, float]:
    """Return the standard errors by name; infinite where they are not known."""
    errors = {one["name"]: one["standard_error"] for one in estimate["coefficients"]}
    return {name: math.inf if error is None else error for name, error in errors.items()}


def _of_estimate(estimate: Json, names: Sequence[str] | None = None) -> Covariance | None:
    """Return the covariance of one stored estimate, without genes whose error is not known."""
    errors = _errors(estimate)
    rows = [k for k, name in enumerate(errors) if math.isfinite(errors[name]) and (names is None or name in names)]
    known = [list(errors)[k] for k in rows]
    correlation = np.array(estimate["correlation"], float)[np.ix_(rows, rows)]
    deviation = np.array([errors[name] for name in known])
    return covariance_of(known, correlation * deviation * deviation[:, None])


def _of_average(estimates: Sequence[Json], free: Sequence[str]) -> Covariance | None:
    """Return the covariance of coefficients under any condition, when their average is taken: that of their scatter.

    That of the average is added, and the whole is widened as n conditions have n - 1 degrees of freedom.
    """
    if len(estimates) < 2:
        return None
    values = np.array([[one["value"] for one in estimate["coefficients"]] for estimate in estimates], float)
    wider = (1.0 + 1.0 / len(values)) * widening(len(values) - 1) ** 2
    return covariance_of(free, wider * np.atleast_2d(np.cov(values.T)))


def _of_law(law: GlobalModel, estimates: Sequence[Json]) -> Covariance | None:
    """Return the covariance of the numbers of a global model, from those of the local estimates and their scatter.

    Each number is a weighted sum of local estimates; the weights are those of the fit
    (:func:`wingfit.calibration.forces.global_model.fit_global`).
    """
    design = np.array([[1.0, c.flap_frequency, c.angle_of_attack] for c in law.conditions])
    errors = [_errors(one) for one in estimates]
    names, maps = list[str](), list[tuple[str, Array, float]]()
    for one in law.genes:
        own = design if one.per_hz or one.per_rad else design[:, :1]
        local = np.array([error[one.name] for error in errors])
        used = np.isfinite(local)
        if used.sum() < own.shape[1]:
            continue
        scatter = one.scatter or 0.0
        variance = local**2 + scatter**2
        weight = np.where(used, 1.0 / np.maximum(np.where(used, variance, 1.0), 1e-300), 0.0)
        inner = np.linalg.inv((own * weight[:, None]).T @ own)
        for k, ending in enumerate(("", ".per_hz", ".per_rad")[: own.shape[1]]):
            names.append(one.name + ending)
            maps.append((one.name, (inner @ (own * weight[:, None]).T)[k], scatter))
    local_covariances = [_of_estimate(one) for one in estimates]
    matrix = np.array([[_between(a, b, local_covariances) for b in maps] for a in maps])
    return covariance_of(names, matrix)


def _with_scatter(law: GlobalModel, estimates: Sequence[Json]) -> GlobalModel:
    """Return ``law`` with the scatter of every gene, widened as it is estimated from few conditions.

    Where the fit did not estimate it, it is that of the local estimates about the law.
    """
    genes = []
    for one in law.genes:
        local = np.array([_value(estimate, one.name) for estimate in estimates])
        at = [one.constant + one.per_hz * c.flap_frequency + one.per_rad * c.angle_of_attack for c in law.conditions]
        freedom = len(local) - (3 if one.per_hz or one.per_rad else 1)
        scatter = one.scatter
        if scatter is None and freedom > 0:
            scatter = float(np.sqrt(np.sum((local - at) ** 2) / freedom))
        genes.append(replace(one, scatter=(scatter or 0.0) * widening(freedom)))
    return replace(law, genes=tuple(genes))


def widening(freedom: float) -> float:
    """Return by what a standard deviation of ``freedom`` degrees of freedom is multiplied for normal 95 % intervals.

    They are then as wide as those of Student's distribution; 1 for infinitely many degrees.
    """
    return float(scipy.special.stdtrit(max(freedom, 1.0), 0.975) / scipy.special.ndtri(0.975))


def _value(estimate: Json, name: str) -> float:
    return next(float(one["value"]) for one in estimate["coefficients"] if one["name"] == name)


def _between(
    one: tuple[str, Array, float], other: tuple[str, Array, float], local: Sequence[Covariance | None]
) -> float:
    """Return the covariance of two numbers of a global model, each a gene with its weights of the local estimates."""
    total = 0.0
    for k, known in enumerate(local):
        shared = one[2] ** 2 if one[0] == other[0] else 0.0
        if known is not None and one[0] in known.names and other[0] in known.names:
            shared += known.matrix[known.names.index(one[0])][known.names.index(other[0])]
        total += float(one[1][k] * other[1][k]) * shared
    return total
