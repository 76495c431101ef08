"""Specifications between the wire and the inside: SI, tuples, and what belongs to the other kind of dataset."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from pydantic import BaseModel

from calibration.search import CalibrationSpec
from records import Dataset, Recording
from service.problems import ErrorItem, error_item, invalid
from service.spec_schemas import RunIn, SpecOut, VehicleModel
from service.units import MM, tidy_mm

# A simulation of a wing may leave the box of a search; how far is the limit of `bounds_factor` itself.
WIDEST_BOUNDS = 100.0
WING_ONLY = ("division", "bounds_factor", "accuracy_mm", "outputs")
VEHICLE_ONLY = ("preset", "without", "axes", "low_pass_hz", "peel_width_beats")


def spec_out(given: CalibrationSpec) -> SpecOut:
    """How a run calibrates, as it goes out."""
    named = {
        "accuracy_mm": tidy_mm(given.accuracy),
        "low_pass_hz": given.low_pass,
        "peel_width_beats": given.peel_width,
    }
    return SpecOut.model_validate(asdict(given) | named)


def of_run(body: RunIn) -> CalibrationSpec:
    """What a request for a run asks for."""
    alike = ("division", "mode", "method", "population", "stall", "tolerance", "max_generations", "seed")
    return CalibrationSpec(
        **{name: getattr(body, name) for name in alike},
        bounds_factor=body.bounds_factor,
        accuracy=body.accuracy_mm / MM,
        recordings=tuple(body.recordings),
        genes=tuple(body.genes),
        finish=body.finish,
        axes=tuple(body.axes),
        **_vehicle(body),
    )


def of_simulation(division: str, accuracy_mm: float, vehicle: VehicleModel | None = None) -> CalibrationSpec:
    """The model that a request for a simulation asks for."""
    return CalibrationSpec(
        division=division,
        bounds_factor=WIDEST_BOUNDS,
        accuracy=accuracy_mm / MM,
        **(_vehicle(vehicle) if vehicle else {}),
    )


def refuse_cutoff(low_pass_hz: float | None, recordings: Iterable[Recording]) -> None:
    """A 422 for a low-pass that takes away the beat itself."""
    for recording in recordings:
        flap = recording.condition.flap_frequency
        if low_pass_hz and low_pass_hz < flap:
            message = (
                f"below the flap frequency of recording {recording.name!r}, {flap:g} Hz, nothing of the beat is left; "
                "give more than that, 0 for no filter, or leave it out for 3.2 times the flap frequency"
            )
            raise invalid("the low-pass does not fit", [error_item("body.low_pass_hz", low_pass_hz, message)])


def refuse_foreign(body: BaseModel, dataset: Dataset) -> None:
    """A 422 for settings of a wing in a request about a vehicle, or the reverse; defaults do no harm."""
    what, names = ("wing", VEHICLE_ONLY) if dataset.kind == "tracks" else ("vehicle", WING_ONLY)
    faults: list[ErrorItem] = []
    for name in names:
        field = type(body).model_fields.get(name)
        if field is not None and getattr(body, name) != field.default:
            message = f"means nothing for a {what}, which the dataset describes; leave it out"
            faults.append(error_item(f"body.{name}", getattr(body, name), message))
    if faults:
        raise invalid(f"the request has settings that a {what} does not have", faults)


def _vehicle(body: VehicleModel) -> dict[str, Any]:
    return {
        "preset": body.preset,
        "without": tuple(body.without),
        "low_pass": body.low_pass_hz,
        "peel_width": body.peel_width_beats,
    }
