"""A good dataset of a wing and one of a vehicle, small enough to check in a moment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wingfit.records import Dataset
from wingfit.sim.virtual_rigs.balance import EXAMPLE, TRIALS, campaign
from wingfit.sim.virtual_rigs.campaign import Tracking, record, robird_wing, true_genome, tunnel, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing

CONDITIONS = (vacuum(10.0, 0.12, 4.0), vacuum(10.0, 0.0, 3.0), tunnel(0.05, 2.0, 8.5))


def good_wing() -> Dataset:
    """Three recordings of the Robird's wing."""
    model = FlexibleWing(robird_wing(), "4")
    made = (record(model, true_genome(model, 3), one, Tracking(), np.random.default_rng(1)) for one in CONDITIONS)
    return Dataset("wing", model.wing, tuple(made))


def good_vehicle() -> Dataset:
    """Three recordings of the DelFly's forces."""
    return campaign(3, replace(EXAMPLE, beats=12), TRIALS[1:7:2])
