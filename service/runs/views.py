"""Converts database rows and calibration results to the API's JSON answers about datasets, runs and tracks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from sqlalchemy.orm import class_mapper

from wingfit.calibration import result as tracks_result
from wingfit.calibration.estimates.uncertainty import Correlations
from wingfit.checks import Mistake
from wingfit.client import answers as a
from wingfit.client.answers import Comparison, Numerics
from wingfit.client.estimates.answers import Correlations as CorrelationsOut
from wingfit.client.recorded.answers import SeriesValues
from wingfit.records import AnyDataset, Channel, Recording, Series, SeriesDataset
from wingfit.records.array_types import Array, Mask
from wingfit.service.answers import answer, checked
from wingfit.service.datasets.gaps import missing
from wingfit.service.outcomes import fit_quality
from wingfit.service.runs.spec_views import run_settings
from wingfit.service.storage import store
from wingfit.service.storage.tables import DatasetRow, RunRow
from wingfit.service.units import MM, finite, mm, mn, tidy_mm
from wingfit.workers.jobs import Wish

T = TypeVar("T")
MOST_SERIES_VALUES = 50_000  # in one answer with a recording of series
MOST_COORDINATES = 1_000_000  # recorded ones in one answer
# Fields that rows of recordings do not have if an earlier version stored them.
LATER: dict[str, Any] = {"channels": [], "settings": {}, "duration_s": None}
# Digits that a page can show; a track in full precision is three times as long on the wire.
TRACK_DECIMALS = 6
PHASE_DECIMALS = 9


def dataset(row: DatasetRow) -> a.Dataset:
    """Return the JSON answer that describes the dataset stored in ``row``."""
    recordings = [LATER | record for record in row.recordings]
    return checked(a.Dataset, columns(row) | {"recordings": recordings, "warnings": row.warnings or []})


def warnings(mistakes: Sequence[Mistake]) -> list[dict[str, Any]]:
    """Return the likely ``mistakes`` in a dataset as its database row stores them."""
    fields = a.DatasetWarning.__annotations__
    return [{name: getattr(one, name) for name in fields} for one in mistakes]


def recording(record: Recording | Series, held_out: bool) -> a.RecordingInfo:
    """Return the JSON answer about one recording and its condition; ``held_out``: used for validation only."""
    if isinstance(record, Series):
        return _series(record, held_out)
    tracked = record.kind == "tracks"
    seen = np.asarray(np.isfinite(record.positions).all(axis=2)) if tracked else record.valid
    return answer(
        a.RecordingInfo,
        record.condition,
        name=record.name,
        rig=record.rig,
        held_out=held_out,
        frames=len(record.times),
        markers=int(seen.any(axis=0).sum()) if tracked else 0,
        channels=[] if tracked else list(record.channels),
        missing_percent=_missing_percent(seen),
        settings={},
        duration_s=float(np.ptp(record.times)),
    )


def _series(record: Series, held_out: bool) -> a.RecordingInfo:
    return {
        "name": record.name,
        "rig": "",
        "held_out": held_out,
        "frames": len(record.times),
        "markers": 0,
        "channels": list(record.channels),
        "missing_percent": _missing_percent(record.valid),
        "settings": dict(record.settings),
        "duration_s": float(np.ptp(record.times)),
        **dict.fromkeys(a.CONDITION),  # type: ignore[typeddict-item]
    }


def series_values(record: Series) -> SeriesValues:
    """Return the values of a recording of series as the JSON answer; of a long one every ``stride``-th sample."""
    stride = max(1, -(-(record.values.size + len(record.inputs) * len(record.times)) // MOST_SERIES_VALUES))
    return {
        "recording": record.name,
        "time_s": record.times[::stride].tolist(),
        "channels": {name: _nulls(record.values[::stride, k]) for k, name in enumerate(record.channels)},
        "inputs": {name: _nulls(values[::stride]) for name, values in record.inputs.items()},
        "stride": stride,
        "period_s": record.period,
        "noise": {one.name: one.standard_deviation for one in record.quantities},
        "missing": {name: missing(record.values[:, k], record.times) for k, name in enumerate(record.channels)},
    }


def _nulls(values: Array) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in values.tolist()]


def _missing_percent(seen: Mask) -> float:
    return round(100.0 * (1.0 - float(seen.mean())), 3) if seen.size else 0.0


def rig_info(loaded: AnyDataset) -> a.RigInfo | None:
    """Return what a dataset of series holds, with units; None for a wing or vehicle."""
    if not isinstance(loaded, SeriesDataset):
        return None
    return {
        "name": loaded.rig,
        "channels": [_channel(one) for one in loaded.channels],
        "inputs": [{"name": one.name, "unit": one.unit, "description": one.description} for one in loaded.inputs],
        "settings": [{"name": one.name, "unit": one.unit, "description": one.description} for one in loaded.settings],
    }


def _channel(one: Channel) -> a.QuantityInfo:
    found: a.QuantityInfo = {"name": one.name, "unit": one.unit, "description": one.description}
    return found | {"place": one.place} if one.place else found


def recordings(loaded: AnyDataset) -> list[a.RecordingInfo]:
    """Return the JSON descriptions of all recordings of a dataset, as its database row stores them."""
    return [recording(r, r.name in loaded.held_out) for r in loaded.recordings]


def run(row: RunRow) -> a.Run:
    """Return the JSON answer that describes the run stored in ``row``."""
    return run_of(columns(row))


def run_of(values: Mapping[str, Any]) -> a.Run:
    """Return the JSON answer that describes a run; ``values``: its database row, column name to value."""
    return job_of(a.Run, values, run_settings(store.spec_from(values["spec"])))


def job_of(shape: type[T], values: Mapping[str, Any], spec: object) -> T:
    """Return the JSON answer about a run or diagnosis, a typed dict ``shape``.

    ``values``: its database row, column name to value; ``spec``: its settings as the answer contains them.
    """
    action = None if values["wish"] == Wish.NONE else values["wish"]
    shown: dict[str, Any] = {"rig": values["rig_name"], "driven": bool(values["driven"])}
    shown["fit_badge"] = fit_quality.badge(values["residual_over_noise"], values["held_out_over_noise"])
    return checked(shape, {**values, **shown, "pending_action": action, "steps": values["generations"], "spec": spec})


def gene(estimated: tracks_result.GeneResult) -> a.GeneInfo:
    """Return the JSON answer about one gene after a calibration, with its standard error in its unit and in percent."""
    error = estimated.absolute_error
    return answer(a.GeneInfo, estimated, standard_error=None if error is None else finite(error))


def correlations(found: Sequence[Correlations]) -> list[CorrelationsOut]:
    """Return the JSON answers about the ``found`` correlations of genes; numbers that are not finite become null."""
    return [
        {"genes": list(one.genes), "values": [[finite(value) for value in row] for row in one.values]} for one in found
    ]


def result(outcome: tracks_result.Result) -> a.Result:
    """Return the JSON answer with the result of a calibration on marker tracks."""
    return answer(
        a.Result,
        outcome,
        kind="tracks",
        genes=[gene(one) for one in outcome.genes],
        correlations=correlations(outcome.correlations),
    )


def comparison(tracks: tracks_result.Comparison) -> Comparison:
    """Return recorded and simulated marker tracks as the JSON answer (mm); of long ones every ``stride``-th sample."""
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
    """Return time steps per beat, number of beats and estimated error of a simulation as the JSON answer."""
    return {
        "accuracy_mm": tidy_mm(tracks.accuracy),
        "estimated_error_mm": mm(tracks.solution.error),
        "steps_per_beat": tracks.solution.steps,
        "beats": tracks.solution.beats,
    }


def mean_distance_mm(tracks: tracks_result.Comparison) -> float | None:
    """Return the mean distance (mm) between simulated and recorded markers; None if no marker was recorded."""
    distance = np.linalg.norm(tracks.simulated - tracks.recorded, axis=2)
    seen = np.isfinite(distance)
    return mm(float(distance[seen].mean())) if seen.any() else None


def misfit(kind: str, distance: float) -> dict[str, float | None]:
    """Return ``distance`` under its name for the ``kind`` of data; the others are None.

    ``best_mm`` of tracks (from m), ``best_mn`` of forces (from N), ``best_percent`` of series (from a fraction).
    """
    return {
        "best_mm": mm(distance) if kind == "tracks" else None,
        "best_mn": mn(distance) if kind == "forces" else None,
        "best_percent": finite(100.0 * distance) if kind == "series" else None,
    }


def track_mm(positions: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Convert ``positions`` (m) to mm, rounded to the digits that JSON answers contain."""
    return np.round(positions * MM, TRACK_DECIMALS)


def tidy_phase(phase: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Round phases (fraction of the beat) to the digits that JSON answers contain."""
    return np.round(phase, PHASE_DECIMALS)


def _track(positions: npt.NDArray[np.float64]) -> list[list[list[float | None]]]:
    rounded = track_mm(positions)
    nested: list[list[list[float | None]]] = np.where(np.isfinite(rounded), rounded, None).tolist()  # type: ignore[call-overload]
    return nested


def columns(row: object) -> dict[str, Any]:
    """Return the columns of a database row as a dict, attribute name to value."""
    return {column.key: getattr(row, column.key) for column in class_mapper(type(row)).column_attrs}
