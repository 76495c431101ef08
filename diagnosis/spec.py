"""The request that starts a diagnosis, and the progress reports of a running diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from wingfit.calibration.spec import CalibrationSpec
from wingfit.diagnosis.finding import Finding
from wingfit.diagnosis.partial_finding import PartialFinding
from wingfit.diagnosis.policy import POLICY, Policy
from wingfit.records.name_lists import refuse_text


@dataclass(frozen=True)
class DiagnosisSpec:
    """What to diagnose and how.

    Attributes:
        calibration: the nominal model (discretisation, preset, terms, effects already in it) and what is fitted
            (recordings, genes, fixed values, low-pass).
        start: initial values of nominal genes by name, such as a calibration's best; other genes start at their
            estimates.
        suspects: names of the effects to consider; empty means the whole library.
        refine: whether the diagnosis may change to a finer discretisation where the present one limits the fit.
        refits: largest number of suspects that are added to the model and fitted, one at a time, after the score tests.
            Where none of them explains forces, all suspects are.
        exhaustive: whether every suspect and every pair of suspects is fitted where the nominal model does not suffice,
            not only those that score tests propose; for at most 20 suspects.
        axes: force axes to fit ("x", "z"); empty means all that every recording has. Ignored for tracks.
        policy: thresholds of the verdict and of the search.
    """

    calibration: CalibrationSpec = field(default_factory=CalibrationSpec)
    start: Mapping[str, float] = field(default_factory=dict)
    suspects: tuple[str, ...] = ()
    refine: bool = True
    refits: int = 8
    exhaustive: bool = False
    axes: tuple[str, ...] = ()
    policy: Policy = POLICY

    def __post_init__(self) -> None:
        refuse_text(self, "suspects", "axes")


@dataclass(frozen=True)
class Progress:
    """A report of a running diagnosis.

    ``fraction`` of the work done (0 to 1), present ``stage`` in words, number of individuals simulated so far
    (``evaluations``), and the ``finding``, None in all reports but the last. ``partial``: what the search knows so far,
    None before the nominal model has been fitted and after the search.
    """

    fraction: float
    stage: str
    evaluations: int
    finding: Finding | None = None
    partial: PartialFinding | None = None
