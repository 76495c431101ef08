"""What a diagnosis was asked for: from the wire, to and from the database, and back to the wire."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

from wingfit.calibration.spec import CalibrationSpec
from wingfit.diagnosis.spec import DiagnosisSpec
from wingfit.service.diagnoses.schemas import DiagnosisIn, DiagnosisSpecOut
from wingfit.service.storage import store
from wingfit.service.units import MM, tidy_mm

# Settings of a request by their names inside, where these differ.
INSIDE = {"accuracy_mm": "accuracy", "low_pass_hz": "low_pass", "peel_width_beats": "peel_width"}
ALIKE = (
    "division", "seed", "bounds_factor", "recordings", "genes", "fixed", "effects", "preset", "without",
)  # fmt: skip


def calibration(body: DiagnosisIn, of_run: CalibrationSpec | None) -> CalibrationSpec:
    """The model that a request asks for: by its own settings, else those of the run, else the usual ones."""
    given: dict[str, Any] = {name: getattr(body, name) for name in body.model_fields_set}
    if "accuracy_mm" in given:
        given["accuracy_mm"] /= MM
    changes = {INSIDE.get(name, name): _frozen(given[name]) for name in (*ALIKE, *INSIDE) if name in given}
    return replace(of_run or CalibrationSpec(), **changes)


def asked(body: DiagnosisIn, model: CalibrationSpec, start: Mapping[str, float]) -> DiagnosisSpec:
    """The diagnosis that a request asks for."""
    return DiagnosisSpec(
        calibration=model,
        start=dict(start),
        suspects=tuple(body.suspects),
        refine=body.refine,
        refits=body.refits,
        axes=tuple(body.axes or ()),
    )


def plain(spec: DiagnosisSpec) -> dict[str, Any]:
    """A specification as JSON, without the thresholds: a request cannot change them."""
    return {name: value for name, value in json.loads(json.dumps(asdict(spec))).items() if name != "policy"}


def stored(values: dict[str, Any]) -> DiagnosisSpec:
    """A specification from its JSON form."""
    tuples: dict[str, Any] = {name: tuple(values[name]) for name in ("suspects", "axes") if name in values}
    own = {name: value for name, value in values.items() if name != "policy"}
    return DiagnosisSpec(**(own | tuples | {"calibration": store.spec_from(values["calibration"])}))


def out(spec: DiagnosisSpec) -> DiagnosisSpecOut:
    """A specification as it goes out."""
    model = asdict(spec.calibration)
    named = {name: model[inside] for name, inside in INSIDE.items()}
    named["accuracy_mm"] = tidy_mm(spec.calibration.accuracy)
    own = {name: getattr(spec, name) for name in ("start", "suspects", "refine", "refits", "axes")}
    return DiagnosisSpecOut.model_validate({name: model[name] for name in ALIKE} | named | own)


def _frozen(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
