"""Models to export: the true wing and the true vehicle of the examples, with effects of typical size."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace

from benchmarks.common.files import EXAMPLES
from wingfit.calibration.spec import CalibrationSpec
from wingfit.export.calibrated_model import CalibratedModel, Provenance
from wingfit.export.from_run import assembled
from wingfit.records import Dataset, Recording, load_dataset, wing_or_vehicle
from wingfit.sim.effects.registry import EFFECTS

SOURCE = Provenance("run", "benchmark", "", "", "", "", "", 1, "2026-01-01T00:00:00Z", "true values")
_IN_AIR = 1e5  # Pa


def true_wing(effects: Sequence[str] = (), division: str = "11") -> CalibratedModel:
    """Return the wing of examples/robird with its true values, fitted to its recordings in the wind tunnel."""
    dataset = wing_or_vehicle(load_dataset(EXAMPLES / "robird"))
    values = json.loads((EXAMPLES / "robird.truth.json").read_text())["genome"]
    fitted = [one for one in dataset.recordings if one.condition.pressure > _IN_AIR]
    return _model(dataset, CalibrationSpec(division=division, effects=tuple(effects)), values, fitted)


def true_vehicle(
    effects: Sequence[str] = (), without: Sequence[str] = (), slopes: Mapping[str, tuple[float, float]] | None = None
) -> CalibratedModel:
    """Return the vehicle of examples/delfly with the true values of its first recording.

    ``slopes``: by coefficient, its change per Hz and per rad.
    """
    dataset = wing_or_vehicle(load_dataset(EXAMPLES / "delfly"))
    values = json.loads((EXAMPLES / "delfly.truth.json").read_text())["coefficients"]["test-1"]
    spec = CalibrationSpec(effects=tuple(effects), without=tuple(without))
    found, more = _model(dataset, spec, values, dataset.recordings), slopes or {}
    parameters = (
        replace(one, per_hz=more.get(one.name, (0.0, 0.0))[0], per_rad=more.get(one.name, (0.0, 0.0))[1])
        for one in found.parameters
    )
    return replace(found, parameters=tuple(parameters))


def _model(
    dataset: Dataset, spec: CalibrationSpec, values: Mapping[str, float], fitted: Sequence[Recording]
) -> CalibratedModel:
    typical = {name: value for one in spec.effects for name, value in EFFECTS[one].typical(dataset.rig).items()}
    return assembled(
        dataset, spec, {**values, **typical}, set(), covariance=None, misfit=(None, None, "m"), fitted=fitted,
        provenance=SOURCE, remarks=(),
    )  # fmt: skip
