"""What a user requests of a diagnosis, and the progress that it reports."""

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
        calibration: the nominal model (discretisation, preset, terms, effects already in it) and what is fitted
            (recordings, genes, fixed values, low-pass).
        start: initial genes, such as a calibration's best; genes that it does not name start at their estimates.
        suspects: names of the effects to consider; empty means the whole library.
        refine: whether the model may take a finer discretisation where the discretisation limits it.
        refits: largest number of suspects that are refitted in full.
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
    """Fraction of the work done, current stage, individuals evaluated so far, and with the last report the finding."""

    fraction: float
    stage: str
    evaluations: int
    finding: Finding | None = None
