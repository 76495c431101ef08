"""Models for tests that need no calibration."""

from __future__ import annotations

from tests.oracles.exports import SOURCE
from wingfit.calibration.problem import base_genome
from wingfit.calibration.spec import CalibrationSpec
from wingfit.calibration.spec import wing_model as model_of
from wingfit.export.calibrated_model import CalibratedModel, Covariance
from wingfit.export.from_run import assembled
from wingfit.records import Dataset
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, tunnel, vacuum


def wing_model() -> CalibratedModel:
    """Return the Robird's wing of four bodies with a lagging circulation, its genes at their estimates."""
    wing = robird_wing()
    conditions = (vacuum(10.0, 0.0, 2.0), tunnel(0.0, 3.0, 3.5), tunnel(0.1, 4.0, 8.5))
    recordings = tuple(blank_recording(wing, one, f"r{k}") for k, one in enumerate(conditions))
    spec, data = (
        CalibrationSpec(division="4", effects=("circulation_lag", "clock_offset")),
        Dataset("d", wing, recordings),
    )
    values = base_genome(model_of(data, spec)).as_dict() | {"circulation_lag.share": 0.8}
    error = 0.05 * values["E_r"]
    return assembled(
        data, spec, values, {"E_r"}, covariance=Covariance(("E_r",), ((error**2,),)), misfit=(1e-3, 5e-4, "m"),
        fitted=recordings, provenance=SOURCE, remarks=(),
    )  # fmt: skip
