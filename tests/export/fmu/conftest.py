"""FMUs for the tests, which take a while to compile: one wing and one vehicle for the whole session."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.oracles.exports.fmus import Fmu, true_vehicle
from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.fmu import NotExportedError, write_fmu
from wingfit.export.fmu.package import c_compiler

EFFECTS = ("clap_and_peel", "varying_coefficients", "airspeed_error", "wing_length_error", "wing_chord_error")


def _written(model: CalibratedModel, folder: Path) -> Path:
    pytest.importorskip("fmpy", reason="FMPy, which imports FMUs, is not installed: pip install 'wingfit[fmu]'")
    try:
        c_compiler()
    except NotExportedError as error:
        pytest.skip(str(error))
    path = folder / "model.fmu"
    write_fmu(model, path)
    return path


@pytest.fixture(scope="session")
def wing_fmu(wing: CalibratedModel, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fmu]:
    """Of four bodies, with an effect that has states."""
    with Fmu(_written(wing, tmp_path_factory.mktemp("wing"))) as fmu:
        yield fmu


@pytest.fixture(scope="session")
def global_vehicle() -> CalibratedModel:
    """With coefficients that follow laws of the condition, and a stream that an effect changes."""
    return true_vehicle(EFFECTS, ("clap_and_peel",), {"C_l": (-0.15, -0.5)})


@pytest.fixture(scope="session")
def vehicle_fmu(global_vehicle: CalibratedModel, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fmu]:
    """Of the vehicle."""
    with Fmu(_written(global_vehicle, tmp_path_factory.mktemp("vehicle"))) as fmu:
        yield fmu
