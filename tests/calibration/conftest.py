from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from records import Dataset, Genome
from sim.flexible_wing import FlexibleWing
from sim.rig import REFERENCE, Tracking, record, robird_wing, true_genome, tunnel, vacuum


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
