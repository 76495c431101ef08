"""What a user asks of a diagnosis, and how it reports on its way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from wingfit.calibration.spec import CalibrationSpec
from wingfit.diagnosis.finding import Finding
from wingfit.diagnosis.policy import POLICY, Policy


@dataclass(frozen=True)
class DiagnosisSpec:
    """What to diagnose and how.

    Attributes:
        calibration: the nominal model (division, preset, terms, effects that it has already) and what is fitted
            (recordings, genes, fixed values, low-pass). Force axes: those named, else all that every recording has.
        start: genome to begin with, such as a calibration's best; genes that it does not name start at their estimates.
        suspects: names of the effects to consider; empty means the whole library.
        refine: whether the model may go to a finer division by itself where the division limits it.
        refits: how many effects are refitted in full at most.
        axes: force axes to fit; empty means all that every recording has.
        policy: thresholds.
    """

    calibration: CalibrationSpec = field(default_factory=CalibrationSpec)
    start: Mapping[str, float] = field(default_factory=dict)
    suspects: tuple[str, ...] = ()
    refine: bool = True
    refits: int = 8
    axes: tuple[str, ...] = ()
    policy: Policy = POLICY


@dataclass(frozen=True)
class Progress:
    """How far a diagnosis is: the part of the work done, what it does now, individuals evaluated; last: the finding."""

    fraction: float
    stage: str
    evaluations: int
    finding: Finding | None = None
