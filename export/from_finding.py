"""Make a calibrated model of a diagnosis: the model of its finding, with the effects that it names."""

from __future__ import annotations

from dataclasses import replace

from wingfit.calibration.spec import CalibrationSpec
from wingfit.diagnosis.evidence.fitted_model import FittedModel
from wingfit.diagnosis.finding import NAMING, Finding
from wingfit.export.calibrated_model import CalibratedModel, Provenance
from wingfit.export.from_run import assembled, covariance_of
from wingfit.records import Dataset

NOMINAL = "nominal"


class ChoiceError(ValueError):
    """The finding has several models, and none or an unknown one was chosen."""


def of_finding(
    spec: CalibrationSpec, dataset: Dataset, finding: Finding, hypothesis: str | None, provenance: Provenance
) -> CalibratedModel:
    """Return the model of ``finding`` with the effects of ``hypothesis`` (:func:`chosen`).

    ``spec``: settings of the nominal model of the diagnosis. ChoiceError if a hypothesis must be chosen.
    """
    fitted = chosen(finding, hypothesis)
    names = {one.name for one in finding.recordings if not one.held_out}
    settings = replace(spec, effects=fitted.effects, division=fitted.division or spec.division)
    found = assembled(
        dataset,
        settings,
        fitted.values,
        set(fitted.free),
        covariance=covariance_of(fitted.free, fitted.covariance) if fitted.covariance else None,
        misfit=(misfit_of(finding, fitted), finding.floors.noise, finding.unit),
        fitted=[one for one in dataset.recordings if one.name in names],
        provenance=replace(provenance, source=source_of(finding, fitted)),
        remarks=finding.remarks,
    )
    return replace(found, elements=fitted.elements, instants=fitted.instants)


def chosen(finding: Finding, hypothesis: str | None) -> FittedModel:
    """Return the model of the ``hypothesis``: effects joined by "+", or "nominal"; None: what the verdict names.

    ChoiceError if the verdict names no effects for certain although it has candidates, for an unknown hypothesis, and
    for a finding of an earlier version, which does not keep its models.
    """
    if not finding.fitted:
        raise ChoiceError(
            "this diagnosis was made by an earlier version of wingfit, which did not keep the fitted models: diagnose "
            "again, or export a run"
        )
    known = {label(one): one for one in reversed(finding.fitted)}
    if hypothesis is not None:
        wanted = "+".join(sorted(part.strip() for part in hypothesis.split("+")))
        if wanted not in known:
            raise ChoiceError(f"no refitted hypothesis {hypothesis!r}; there are {_listed(finding)}")
        return known[wanted]
    best = finding.fitted[0]
    if finding.verdict in NAMING or not best.added:
        return best
    raise ChoiceError(
        f"the verdict is {finding.verdict!r}, so that several models are possible: choose one (--hypothesis, over HTTP "
        f"hypothesis=) of {_listed(finding)}"
    )


def label(fitted: FittedModel) -> str:
    """Return the name of a hypothesis: its effects in alphabetical order, joined by "+", or "nominal"."""
    return "+".join(sorted(fitted.added)) or NOMINAL


def misfit_of(finding: Finding, fitted: FittedModel) -> float | None:
    """Return the misfit of the model ``fitted``, in the unit of ``finding``; None if it has none."""
    return next((one.misfit for one in finding.hypotheses if set(one.effects) == set(fitted.added)), None)


def source_of(finding: Finding, fitted: FittedModel) -> str:
    """Return what the model ``fitted`` of ``finding`` is, in words."""
    added = f"the nominal model with {', '.join(fitted.added)}" if fitted.added else "the nominal model, refitted"
    return f"{added}; verdict: {finding.verdict}"


def _listed(finding: Finding) -> str:
    shares = {frozenset(one.effects): one.probability for one in finding.hypotheses}
    parts = [f"{label(one)} ({100 * shares.get(frozenset(one.added), 0.0):.0f} %)" for one in finding.fitted]
    return ", ".join(dict.fromkeys(parts))
