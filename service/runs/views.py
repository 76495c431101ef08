"""Converts database rows and results of calibrations to the API's JSON answers about datasets, runs and tracks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from sqlalchemy.orm import class_mapper

from wingfit.calibration import result as tracks_result
from wingfit.client import answers as a
from wingfit.client.answers import Comparison, Numerics
from wingfit.records import Dataset, Recording
from wingfit.service.answers import answer, checked
from wingfit.service.runs.spec_views import run_settings
from wingfit.service.storage import store
from wingfit.service.storage.tables import DatasetRow, RunRow
from wingfit.service.units import MM, finite, mm, mn, tidy_mm
from wingfit.workers.jobs import Wish

T = TypeVar("T")
MOST_COORDINATES = 1_000_000  # recorded ones in one answer
# Fields that rows of recordings do not have if they were stored before datasets could contain forces.
BEFORE_FORCES: dict[str, Any] = {"channels": []}
# Digits that a page can show; a track in full precision is three times as long on the wire.
TRACK_DECIMALS = 6
PHASE_DECIMALS = 9


def dataset(row: DatasetRow) -> a.Dataset:
    """The JSON answer that describes a dataset, from its row."""
    recordings = [BEFORE_FORCES | record for record in row.recordings]
    return checked(a.Dataset, columns(row) | {"recordings": recordings})


def recording(record: Recording, held_out: bool) -> a.RecordingInfo:
    """One recording with its condition."""
    tracked = record.kind == "tracks"
    seen = np.isfinite(record.positions).all(axis=2) if tracked else record.valid
    return answer(
        a.RecordingInfo,
        record.condition,
        name=record.name,
        rig=record.rig,
        held_out=held_out,
        frames=len(record.times),
        markers=int(seen.any(axis=0).sum()) if tracked else 0,
        channels=[] if tracked else list(record.channels),
        missing_percent=round(100.0 * (1.0 - float(seen.mean())), 3) if seen.size else 0.0,
    )


def recordings(loaded: Dataset) -> list[a.RecordingInfo]:
    """All recordings of a dataset, as they are stored in its row."""
    return [recording(r, r.name in loaded.held_out) for r in loaded.recordings]


def run(row: RunRow) -> a.Run:
    """The JSON answer that describes a run, from its row."""
    return run_of(columns(row))


def run_of(values: Mapping[str, Any]) -> a.Run:
    """The JSON answer that describes a run, from ``values``: column name of its row to value."""
    return job_of(a.Run, values, run_settings(store.spec_from(values["spec"])))


def job_of(shape: type[T], values: Mapping[str, Any], spec: object) -> T:
    """The JSON answer ``shape`` about a run or diagnosis, from its row (``values`` by column) and its settings."""
    action = None if values["wish"] == Wish.NONE else values["wish"]
    return checked(shape, {**values, "pending_action": action, "steps": values["generations"], "spec": spec})


def gene(estimated: tracks_result.GeneResult) -> a.GeneInfo:
    """One gene after the calibration; its relative standard error becomes a percentage."""
    error = estimated.absolute_error
    return answer(a.GeneInfo, estimated, standard_error=None if error is None else finite(error))


def result(outcome: tracks_result.Result) -> a.Result:
    """The result of a calibration on tracks as the JSON answer."""
    return answer(a.Result, outcome, kind="tracks", genes=[gene(one) for one in outcome.genes])


def comparison(tracks: tracks_result.Comparison) -> Comparison:
    """Recorded and simulated tracks as the JSON answer (mm)."""
    stride = max(1, -(-tracks.recorded.size // MOST_COORDINATES))
    return {
        "recording": tracks.recording,
        "phase": tidy_phase(tracks.phase[::stride]).tolist(),
        "markers": list(tracks.markers),
        "recorded_mm": _track(tracks.recorded[::stride]),
        "simulated_mm": _track(tracks.simulated[::stride]),
        "stride": stride,
        "numerics": numerics(tracks),
    }


def numerics(tracks: tracks_result.Comparison) -> Numerics:
    """Time steps, beats and error of a simulation as the JSON answer."""
    return {
        "accuracy_mm": tidy_mm(tracks.accuracy),
        "estimated_error_mm": mm(tracks.solution.error),
        "steps_per_beat": tracks.solution.steps,
        "beats": tracks.solution.beats,
    }


def mean_distance_mm(tracks: tracks_result.Comparison) -> float | None:
    """Mean distance (mm) over the recorded markers and frames; None where nothing was recorded."""
    distance = np.linalg.norm(tracks.simulated - tracks.recorded, axis=2)
    seen = np.isfinite(distance)
    return mm(float(distance[seen].mean())) if seen.any() else None


def misfit(kind: str, distance: float) -> dict[str, float | None]:
    """``distance`` as ``best_mm`` of tracks (from m) or as ``best_mn`` of forces (from N); the other is null."""
    tracks = kind == "tracks"
    return {"best_mm": mm(distance) if tracks else None, "best_mn": None if tracks else mn(distance)}


def track_mm(positions: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Positions (m) in mm, rounded as in answers."""
    return np.round(positions * MM, TRACK_DECIMALS)


def tidy_phase(phase: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Phases (fraction of the beat), rounded as in answers."""
    return np.round(phase, PHASE_DECIMALS)


def _track(positions: npt.NDArray[np.float64]) -> list[list[list[float | None]]]:
    rounded = track_mm(positions)
    nested: list[list[list[float | None]]] = np.where(np.isfinite(rounded), rounded, None).tolist()  # type: ignore[call-overload]
    return nested


def columns(row: object) -> dict[str, Any]:
    """The columns of a database row as a dict: attribute name to value."""
    return {column.key: getattr(row, column.key) for column in class_mapper(type(row)).column_attrs}
