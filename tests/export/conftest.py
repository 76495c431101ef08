"""Calibrated models that take seconds: a vehicle on four short recordings, and the example wing, not calibrated."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.export.samples import wing_model
from tests.oracles.exports import SOURCE, calibrated_vehicle
from wingfit.export.calibrated_model import CalibratedModel
from wingfit.sim.virtual_rigs.balance import TRIALS, Balance, campaign


@pytest.fixture(scope="session")
def vehicle() -> CalibratedModel:
    """With the global model of seven recordings."""
    found = calibrated_vehicle(campaign(3, Balance(every=25, beats=10), TRIALS[:7]))
    return replace(found, provenance=replace(SOURCE, id="run_1", source=found.provenance.source))


@pytest.fixture(scope="session")
def wing() -> CalibratedModel:
    """Of four bodies, with one effect."""
    return wing_model()
