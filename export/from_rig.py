"""Make a calibrated model of a rig with a simulation of the user's own: its parameters, without the simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import entry_points
from typing import Any

from wingfit.calibration.preparation import prepare_rig
from wingfit.calibration.spec import CalibrationSpec
from wingfit.diagnosis.finding import Finding
from wingfit.export.calibrated_model import AnyRig, CalibratedModel, Covariance, FittedRange, FittedRecording, Parameter
from wingfit.export.from_finding import chosen, misfit_of, source_of
from wingfit.export.from_run import NO_COVARIANCE, covariance_of
from wingfit.export.runtime.parts import Provenance
from wingfit.records import Gene, Series, SeriesDataset
from wingfit.rigs.load import GROUP
from wingfit.rigs.rig import Rig
from wingfit.rigs.rig_model import RigModel

Json = Mapping[str, Any]


def of_series(
    spec: CalibrationSpec, rig: Rig, dataset: SeriesDataset, genome: Mapping[str, float], result: Json,
    provenance: Provenance,
) -> CalibratedModel:  # fmt: skip
    """Return the model of a run on series, with the best ``genome`` (by name) and the stored ``result``."""
    known = result.get("covariance")
    model = _model(spec, rig, dataset, ())
    return _assembled(
        model,
        spec,
        dataset,
        genome,
        {one["name"] for one in result["genes"] if one["searched"]},
        covariance_of(known["names"], known["matrix"]) if known else None,
        (result["after"], 1.0 if result["relative_to"] == "noise" else None, result["relative_to"]),
        [one["name"] for one in result["recordings"] if one["fitted"]],
        replace(provenance, source="best genome of the calibration"),
        result["remarks"],
    )


def of_series_finding(
    spec: CalibrationSpec, rig: Rig, dataset: SeriesDataset, finding: Finding, hypothesis: str | None,
    provenance: Provenance,
) -> CalibratedModel:  # fmt: skip
    """Return the model of a diagnosis of a rig, with the effects of ``hypothesis``; as for other rigs."""
    fitted = chosen(finding, hypothesis)
    return _assembled(
        _model(spec, rig, dataset, fitted.added),
        replace(spec, effects=fitted.effects),
        dataset,
        fitted.values,
        set(fitted.free),
        covariance_of(fitted.free, fitted.covariance) if fitted.covariance else None,
        (misfit_of(finding, fitted), finding.floors.noise, finding.unit),
        [one.name for one in finding.recordings if not one.held_out],
        replace(provenance, source=source_of(finding, fitted)),
        finding.remarks,
    )


def _model(spec: CalibrationSpec, rig: Rig, dataset: SeriesDataset, added: Sequence[str]) -> RigModel:
    model = prepare_rig(spec, rig, dataset).model
    if not isinstance(model, RigModel):
        raise TypeError("a rig has a model of its own")
    return model.with_effects(*added)


def _assembled(
    model: RigModel,
    spec: CalibrationSpec,
    dataset: SeriesDataset,
    values: Mapping[str, float],
    estimated: set[str],
    covariance: Covariance | None,
    misfit: tuple[float | None, float | None, str],
    names: Sequence[str],
    provenance: Provenance,
    remarks: Sequence[str],
) -> CalibratedModel:
    rig, fitted = model.rig, dataset.select(names)
    own = {suspect.name for suspect in rig.suspects}
    foreign = [one.name for one in model.added if one.name not in own]
    skipped = {gene.name for one in model.added if one.name in foreign for gene in one.genes}
    genes = [gene for gene in model.genes if gene.name not in skipped]
    said = [
        *remarks,
        *([f"not in the simulation itself, and not part of the model: {', '.join(foreign)}"] if foreign else []),
        *([NO_COVARIANCE] if covariance is None else []),
    ]
    return CalibratedModel(
        kind="series",
        rig=_described(rig),
        settings=replace(spec, fixed={}, recordings=(), genes=()),
        parameters=tuple(
            _parameter(gene, values.get(gene.name, gene.nominal), gene.name in estimated) for gene in genes
        ),
        covariance=covariance,
        misfit=misfit[0],
        noise=misfit[1],
        misfit_unit=misfit[2],
        ranges=_ranges(rig, fitted),
        recordings=tuple(FittedRecording(one.name, None, dict(one.settings)) for one in fitted),
        provenance=provenance,
        remarks=tuple(said),
    )


def _parameter(gene: Gene, value: float, estimated: bool) -> Parameter:
    return Parameter(gene.name, gene.unit, gene.description, value, gene.lower, gene.upper, estimated)


def _ranges(rig: Rig, fitted: Sequence[Series]) -> tuple[FittedRange, ...]:
    found = []
    for name, unit in rig.settings.items():
        values = [one.settings[name] for one in fitted if name in one.settings]
        if values:
            found.append(FittedRange(name, unit, min(values), max(values)))
    return tuple(found)


def _described(rig: Rig) -> AnyRig:
    """Return how the rig is found again; a plug-in has its package with the version."""
    known = next((one for one in entry_points(group=GROUP) if one.name == rig.reference), None)
    package = known.dist if known is not None else None
    return AnyRig(
        name=rig.name,
        plug_in=rig.reference if known else "",
        package=package.name if package else "",
        version=package.version if package else "",
        channels=dict(rig.channels),
        settings=dict(rig.settings),
    )
