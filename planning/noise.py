"""The noise that a plan expects: stated, seen in recordings, or a default."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wingfit.inference.campaign.noise_level import MEMORY, NoiseLevel, seen_noise
from wingfit.planning.spec import PlanSpec
from wingfit.records import Dataset, Recording


def noise_for(dataset: Dataset, recordings: Sequence[Recording], spec: PlanSpec) -> NoiseLevel:
    """Return the noise that ``spec`` states or, where it does not, that ``recordings`` show, or else the default."""
    tracks = dataset.kind == "tracks"
    found = seen_noise(recordings, tracks=tracks)
    stated = spec.noise_mm if tracks else spec.noise_mn
    if stated is not None:
        found = replace(found, deviation=np.full(len(found.deviation), 1e-3 * stated), source="stated")
    if spec.correlation is not None:
        found = replace(found, correlation=spec.correlation)
    if spec.scatter_percent is not None:
        found = replace(found, scatter=spec.scatter_percent / 100.0, memory=MEMORY, source_of_scatter="stated")
    if spec.zero_mn is not None:
        found = replace(found, zero=1e-3 * spec.zero_mn)
    return found
