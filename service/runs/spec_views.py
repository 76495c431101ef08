"""Converts requests to specifications of calibrations, and these to JSON; refuses settings that do not fit the data."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields, replace
from typing import Any

from pydantic import BaseModel

from wingfit.calibration.effects import effect_of
from wingfit.calibration.search import CalibrationSpec
from wingfit.client.answers import RunSpec
from wingfit.records import AnyDataset, Dataset, Recording, SeriesDataset
from wingfit.service.answers import answer, in_si
from wingfit.service.http.problems import ErrorItem, error_item, invalid
from wingfit.service.outcomes.requests import WingIn
from wingfit.service.runs.requests import RunIn, VehicleModel
from wingfit.service.runs.spec_fields_by_kind import IDLE, VEHICLE_ONLY, WING_ONLY
from wingfit.service.units import tidy_mm
from wingfit.sim.effects.registry import chosen
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.vehicle.terms import PRESETS
from wingfit.sim.vehicle.terms import chosen as terms_of

SPEC_FIELDS = {field.name for field in fields(CalibrationSpec)}
# Genes of a simulated wing may lie outside the bounds of a search, up to the limit of `bounds_factor`.
WIDEST_BOUNDS = 100.0
METHODS = {"genetic": "genetic", "cma_es": "CMA-ES", "gauss_newton": "Gauss-Newton", "auto": "auto"}
WHY_IDLE = {
    "gauss_newton": "which searches nothing; leave it out, or use genetic or cma_es",
    "auto": "which ends with Gauss-Newton in any case; leave it out",
}
USUAL = {"tracks": "genetic", "forces": "gauss_newton", "series": "auto"}


def run_settings(spec: CalibrationSpec) -> RunSpec:
    """Return the settings of a run as the JSON answers contain them, in the API's units."""
    return answer(RunSpec, spec, accuracy_mm=tidy_mm(spec.accuracy))


def calibration_spec(body: BaseModel, base: CalibrationSpec | None = None) -> CalibrationSpec:
    """Return the specification that the request ``body`` describes.

    Fields that the request does not contain are those of ``base``, or the defaults if ``base`` is None.
    """
    given = in_si({name: getattr(body, name) for name in body.model_fields_set})
    changes: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in given.items() if name in SPEC_FIELDS
    }
    return replace(base or CalibrationSpec(), **changes)


def simulation_spec(body: WingIn) -> CalibrationSpec:
    """Return the specification of the model in ``body``, a request for a simulation, with the widest gene bounds."""
    return replace(calibration_spec(body), bounds_factor=WIDEST_BOUNDS)


def refuse_cutoff(low_pass_hz: float | None, recordings: Iterable[Recording]) -> None:
    """Raise a 422 if the low-pass cut-off is below the flap frequency of a recording (None, 0: none to check)."""
    for recording in recordings:
        flap = recording.condition.flap_frequency
        if low_pass_hz and low_pass_hz < flap:
            message = (
                f"below the flap frequency of recording {recording.name!r}, {flap:g} Hz, nothing of the beat is left; "
                "give more than that, 0 for no filter, or leave it out for 3.2 times the flap frequency"
            )
            raise invalid("the low-pass does not fit", [error_item("body.low_pass_hz", low_pass_hz, message)])


def refuse_effects(names: Sequence[str], dataset: Dataset, vehicle: VehicleModel | None = None) -> None:
    """Raise a 422 for effects that are unknown, repeated, not applicable to the dataset, or already in the model.

    ``names``: the requested effects; ``vehicle``: the requested model of a vehicle, whose terms may include an effect.
    Only the first fault lists the known effects.
    """
    faults, listed = [], set[str]()
    for place, name in enumerate(names):
        try:
            chosen([name] * names[: place + 1].count(name), dataset.rig)
            _refuse_terms(name, dataset, vehicle)
        except ValueError as error:
            head, _, known = str(error).partition("; there are ")
            message = f"{head}; see those named above" if known and known in listed else str(error)
            listed.add(known)
            faults.append(error_item(f"body.effects.{place}", name, message))
    if faults:
        raise invalid("the model cannot contain these effects; GET /v1/effects lists them all", faults)


def unknown_genes(named: Iterable[tuple[str, str]], known: Sequence[str]) -> list[ErrorItem]:
    """Return an error item for each gene in ``named`` that is not in ``known``, the names of the model's genes.

    ``named``: (place in the request, gene name). Only the first item lists the known genes.
    """
    faults, remedy = [], f"known are {', '.join(known)}"
    for where, name in named:
        if name in known:
            continue
        effect = effect_of(name)
        if effect:
            message = (
                f"belongs to effect {effect.name!r}, which the request does not include; name it in 'effects' "
                f"(--with {effect.name})"
            )
        else:
            message, remedy = f"unknown gene; {remedy}", "see those named above"
        faults.append(error_item(where, name, message))
    return faults


FOREIGN = {
    "tracks": ("wing", VEHICLE_ONLY),
    "forces": ("vehicle", WING_ONLY),
    "series": ("rig of your own", (*WING_ONLY, *VEHICLE_ONLY)),
}


def refuse_foreign(body: BaseModel, dataset: AnyDataset) -> None:
    """Raise a 422 for settings that do not apply to the rig of ``dataset``, such as a vehicle's in one of a wing.

    Settings that have their default value are ignored.
    """
    what, names = FOREIGN[dataset.kind]
    message = f"means nothing for a {what}, which the dataset describes; leave it out"
    if faults := _given(body, names, message):
        raise invalid(f"the request has settings that a {what} does not have", faults)


def refuse_idle(body: RunIn, method: str | None) -> None:
    """Raise a 422 for settings that mean nothing for the ``method``: of a search, if it is Gauss-Newton.

    Settings that have their default value are ignored.
    """
    if method not in IDLE:
        return
    message = f"means nothing for the method {method}, {WHY_IDLE[method]}"
    if faults := _given(body, IDLE[method], message):
        raise invalid("the request has settings that its method does not use", faults)


def run_name(dataset: AnyDataset, spec: CalibrationSpec) -> str:
    """Return the default name of a run, made of the settings in which runs on the same dataset usually differ."""
    unusual = spec.method not in (None, USUAL[dataset.kind])
    method = METHODS.get(spec.method or "", spec.method) if unusual else None
    if spec.finish:
        method = f"{METHODS.get(spec.method or '', spec.method)} finished by Gauss-Newton"
    coarse = f"searched with division {spec.search_division}" if spec.search_division else None
    parts = (dataset.name, model_name(dataset, spec), spec.mode, method, coarse)
    return ", ".join(part for part in parts if part)


def model_name(dataset: AnyDataset, spec: CalibrationSpec) -> str:
    """Return the model in words for names of runs and diagnoses, e.g. "division 11 with hinge_offset"."""
    if isinstance(dataset, SeriesDataset):
        model = dataset.rig
    else:
        model = f"division {spec.division}" if dataset.kind == "tracks" else spec.preset
    if spec.without:
        model += f" without {', '.join(spec.without)}"
    if spec.effects:
        model += f" with {', '.join(spec.effects)}"
    return model


def _refuse_terms(name: str, dataset: Dataset, vehicle: VehicleModel | None) -> None:
    """Raise ValueError if the vehicle's model already has effect ``name`` as a term or the effect does not fit it.

    Does nothing for a wing.
    """
    if vehicle is None or dataset.kind != "forces" or set(vehicle.without) - set(PRESETS[vehicle.preset].terms):
        return  # unknown terms are reported by another check
    terms = terms_of(vehicle.preset, tuple(vehicle.without))
    if name in terms:
        raise ValueError(
            f"effect {name!r} is a term of the model {vehicle.preset!r} already; leave the effect out, or the term: "
            f'without: ["{name}"] (--without {name})'
        )
    BladeElementWing(dataset.vehicle, terms, effects=(name,))


def _given(body: BaseModel, names: Iterable[str], message: str) -> list[ErrorItem]:
    """Return an error item with ``message`` for each setting in ``names`` that differs from its default."""
    fields = type(body).model_fields
    given = [name for name in names if name in fields and getattr(body, name) != fields[name].default]
    return [error_item(f"body.{name}", getattr(body, name), message) for name in given]
