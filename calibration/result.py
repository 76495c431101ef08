"""What a calibration hands out: genes with their standing, misfits before and after, tracks to lay over each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from calibration.evaluator import Evaluator
from calibration.search import CalibrationSpec
from records import Dataset


@dataclass(frozen=True)
class GeneResult:
    """One gene after the calibration. Shares are normalised to sum to one.

    ``standard_error`` is relative to the value, from the misfit's curvature and the residual scatter; ``identifiable``
    says whether the data can tell the gene; None where the gene was not searched.
    """

    name: str
    unit: str
    description: str
    nominal: float
    best: float
    lower: float
    upper: float
    searched: bool
    standard_error: float | None
    identifiable: bool | None


@dataclass(frozen=True)
class RecordingResult:
    """Mean distance per marker (m) on one recording, with the nominal and with the best genome."""

    name: str
    held_out: bool
    stage: str | None
    samples: int
    before: float
    after: float


@dataclass(frozen=True)
class Result:
    """Outcome of a calibration; distances in m, means over recordings weighted by samples.

    ``noise`` is the mean distance that tracking noise alone leaves, estimated from the scatter between beats.
    """

    genes: tuple[GeneResult, ...]
    recordings: tuple[RecordingResult, ...]
    before: float
    after: float
    held_out_before: float | None
    held_out_after: float | None
    noise: float | None


@dataclass(frozen=True)
class Comparison:
    """Simulated and recorded tracks of one recording, [T, M, 3] in m; NaN where not recorded.

    ``phase`` is the phase of the beat in [0, 1), zero where the reference crosses the horizontal on the upstroke.
    """

    recording: str
    phase: npt.NDArray[np.float64]
    markers: tuple[str, ...]
    recorded: npt.NDArray[np.float64]
    simulated: npt.NDArray[np.float64]


def summarise(spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, genome: Mapping[str, float]) -> Result:
    """Judge ``genome`` (full, by name) on every recording of the dataset, the held-out ones too."""
    raise NotImplementedError


def compare(spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float], recording: str) -> Comparison:
    """Tracks of ``genome`` over the recording called ``recording``; ValueError when the simulation fails."""
    raise NotImplementedError
