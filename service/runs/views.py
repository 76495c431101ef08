"""From rows and domain objects to the wire: SI to mm, degrees and mbar; numbers that do not exist to null."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from wingfit.calibration.result import Comparison, GeneResult, Result
from wingfit.records import Dataset, Recording
from wingfit.service.runs import schemas
from wingfit.service.runs.spec_views import spec_out
from wingfit.service.storage import store
from wingfit.service.storage.tables import DatasetRow, GenerationRow, RunRow, Table
from wingfit.service.units import MM, PASCAL_PER_MBAR, ZERO_CELSIUS, finite, mm, mn, tidy_mm
from wingfit.workers.jobs import Wish

# What rows of recordings lack that were stored before there were forces.
BEFORE_FORCES: dict[str, Any] = {"channels": []}
# Digits that a page can show; a track in full precision is three times as long on the wire.
TRACK_DECIMALS = 6
PHASE_DECIMALS = 9


def dataset(row: DatasetRow) -> schemas.DatasetOut:
    """A dataset as lists show it."""
    whole = columns(row)
    whole["recordings"] = [BEFORE_FORCES | record for record in whole["recordings"]]
    return schemas.DatasetOut.model_validate(whole)


def recording(record: Recording, held_out: bool) -> schemas.RecordingOut:
    """One recording with its condition."""
    condition = record.condition
    tracked = record.kind == "tracks"
    seen = np.isfinite(record.positions).all(axis=2) if tracked else record.valid
    return schemas.RecordingOut(
        name=record.name,
        rig=record.rig,
        held_out=held_out,
        frames=len(record.times),
        markers=int(seen.any(axis=0).sum()) if tracked else 0,
        channels=[] if tracked else list(record.channels),
        missing_percent=round(100.0 * (1.0 - float(seen.mean())), 3) if seen.size else 0.0,
        flap_frequency_hz=condition.flap_frequency,
        phase_lag_deg=math.degrees(condition.phase_lag),
        pressure_mbar=condition.pressure / PASCAL_PER_MBAR,
        temperature_c=condition.temperature - ZERO_CELSIUS,
        airspeed_m_s=condition.airspeed,
        angle_of_attack_deg=math.degrees(condition.angle_of_attack),
    )


def recordings(loaded: Dataset) -> list[dict[str, Any]]:
    """All recordings of a dataset, as its row keeps them."""
    return [recording(r, r.name in loaded.held_out).model_dump(mode="json") for r in loaded.recordings]


def run(row: RunRow) -> schemas.RunOut:
    """A run."""
    return run_of(columns(row))


def run_of(values: Mapping[str, Any]) -> schemas.RunOut:
    """A run from the values of its row."""
    wish = None if values["wish"] == Wish.NONE else values["wish"]
    spec = spec_out(store.spec_from(values["spec"]))
    return schemas.RunOut.model_validate({**values, "wish": wish, "spec": spec})


def history_item(row: GenerationRow) -> schemas.HistoryItem:
    """A generation of the history."""
    return schemas.HistoryItem.model_validate(columns(row))


def generation_event(row: GenerationRow) -> schemas.GenerationEvent:
    """A generation as an event."""
    return schemas.GenerationEvent.model_validate(columns(row))


def gene(result: GeneResult) -> schemas.GeneOut:
    """One gene after the calibration."""
    error = result.standard_error
    return schemas.GeneOut(
        name=result.name,
        unit=result.unit,
        description=result.description,
        nominal=result.nominal,
        best=result.best,
        lower=result.lower,
        upper=result.upper,
        searched=result.searched,
        standard_error_percent=None if error is None else finite(100.0 * error),
        identifiable=result.identifiable,
        standard_error=None if result.absolute_error is None else finite(result.absolute_error),
    )


def result(outcome: Result) -> schemas.ResultOut:
    """The outcome of a calibration on tracks."""
    return schemas.ResultOut(
        kind="tracks",
        before_mm=mm(outcome.before),
        after_mm=mm(outcome.after),
        held_out_before_mm=mm(outcome.held_out_before),
        held_out_after_mm=mm(outcome.held_out_after),
        noise_mm=mm(outcome.noise),
        remarks=list(outcome.remarks),
        recordings=[
            schemas.RecordingResultOut(
                name=r.name,
                held_out=r.held_out,
                stage=r.stage,
                samples=r.samples,
                before_mm=mm(r.before),
                after_mm=mm(r.after),
            )
            for r in outcome.recordings
        ],
        genes=[gene(g) for g in outcome.genes],
    )


def comparison(tracks: Comparison) -> dict[str, Any]:
    """Tracks as plain JSON: validating every coordinate would take longer than simulating them."""
    every = max(1, -(-tracks.recorded.size // schemas.MOST_COORDINATES))
    return {
        "recording": tracks.recording,
        "phase": tidy_phase(tracks.phase[::every]).tolist(),
        "markers": list(tracks.markers),
        "recorded_mm": _track(tracks.recorded[::every]),
        "simulated_mm": _track(tracks.simulated[::every]),
        "every": every,
        "numerics": numerics(tracks),
    }


def numerics(tracks: Comparison) -> dict[str, Any]:
    """How a simulation was solved (`schemas.NumericsOut`)."""
    return {
        "accuracy_mm": tidy_mm(tracks.accuracy),
        "estimated_error_mm": mm(tracks.solution.error),
        "steps_per_beat": tracks.solution.steps,
        "beats": tracks.solution.beats,
    }


def mean_distance_mm(tracks: Comparison) -> float | None:
    """Mean distance per marker and frame, over what was recorded."""
    distance = np.linalg.norm(tracks.simulated - tracks.recorded, axis=2)
    seen = np.isfinite(distance)
    return mm(float(distance[seen].mean())) if seen.any() else None


def misfit(kind: str, distance: float) -> dict[str, float | None]:
    """A misfit (m or N, after the kind of the dataset) in the units of people; the other is null."""
    tracks = kind == "tracks"
    return {"best_mm": mm(distance) if tracks else None, "best_mn": None if tracks else mn(distance)}


def track_mm(positions: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Positions (m) in mm, with the digits that go out."""
    return np.round(positions * MM, TRACK_DECIMALS)


def tidy_phase(phase: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Phases with the digits that go out."""
    return np.round(phase, PHASE_DECIMALS)


def _track(positions: npt.NDArray[np.float64]) -> list[list[list[float | None]]]:
    rounded = track_mm(positions)
    plain = rounded.astype(object)
    plain[~np.isfinite(rounded)] = None
    nested: list[list[list[float | None]]] = plain.tolist()
    return nested


def columns(row: Table) -> dict[str, Any]:
    """A row as a dict."""
    return {column.key: getattr(row, column.key) for column in row.__table__.columns}
