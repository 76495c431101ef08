from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wingfit.calibration.problem import base_genome
from wingfit.records import Condition, Dataset, Genome, Recording
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.virtual_rigs.balance import delfly
from wingfit.sim.virtual_rigs.campaign import REFERENCE, Tracking, record, robird_wing, true_genome, tunnel, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing

FORCE_TRUTHS = ({"C_l": 1.22, "C_r": 1.45, "C_F": 1.57}, {"C_l": 1.43, "C_r": 1.39, "C_F": 1.61})


@pytest.fixture(scope="session")
def forces() -> Dataset:
    """Two recordings of a vehicle's forces, eight beats each with 1 mN of white noise, coefficients known."""
    model, recordings = BladeElementWing(delfly()), []
    for k, (truth, (speed, pitch, frequency)) in enumerate(
        zip(FORCE_TRUTHS, ((0.5, 74.0, 12.5), (0.7, 62.0, 11.7)), strict=True)
    ):
        condition = Condition(frequency, 0.0, 101325.0, 293.15, speed, np.radians(pitch))
        times = np.arange(640) / 1000.0
        blank = Recording(f"test-{k}", "wind_tunnel", condition, times, (), np.zeros((640, 2)), forces=("x", "z"))
        clean = model.observe([base_genome(model, truth).values], blank).channels[0]
        noise = 1e-3 * np.random.default_rng(k).normal(size=clean.shape)
        recordings.append(replace(blank, values=clean + noise))
    return Dataset("forces", delfly(), tuple(recordings))


@pytest.fixture(scope="session")
def small() -> tuple[Dataset, Genome]:
    """Four recordings of a 4-body wing, one of each kind held out, and the truth."""
    wing = robird_wing()
    model = FlexibleWing(wing, "4", numerics=REFERENCE)
    truth = true_genome(model, 2)
    conditions = [vacuum(10, 0.05, 3.0), tunnel(0.05, 3.0, 6.0), vacuum(10, 0.12, 2.0), tunnel(0.0, 3.0, 8.5)]
    recordings = tuple(
        record(model, truth, c, Tracking(beats=2), np.random.default_rng(k)) for k, c in enumerate(conditions)
    )
    return Dataset("small", wing, recordings, (recordings[2].name, recordings[3].name)), truth


@pytest.fixture
def marker_only(small: tuple[Dataset, Genome]) -> Dataset:
    """The same dataset with everything held out."""
    dataset, _ = small
    return replace(dataset, held_out=tuple(r.name for r in dataset.recordings))
