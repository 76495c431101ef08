"""A small deterministic diagnosis in place of the real one, so that the service's own part is tested in milliseconds.

It evaluates nothing; its finding is drawn from the seed and says where it started. ``gate`` holds it before each step.
"""

# ruff: noqa: ARG002  it takes what the real one takes and needs little of it
from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from tests.service.toy import UNLUCKY
from wingfit import report
from wingfit.calibration.evaluator import Evaluator
from wingfit.diagnosis.advice.advised import Advice, AdvisedCondition
from wingfit.diagnosis.finding import (
    Exponent,
    Finding,
    Floors,
    GeneValue,
    Hypothesis,
    Interval,
    MarkerMisfit,
    MissingLoad,
    Overlay,
    PhaseMap,
    Proof,
    RecordingMisfit,
    Where,
)
from wingfit.diagnosis.partial_finding import Lead, PartialFinding, PlaceMisfit
from wingfit.diagnosis.spec import DiagnosisSpec, Progress
from wingfit.records import AnyDataset, Dataset, wing_or_vehicle
from wingfit.rigs.rig import Rig
from wingfit.service.diagnoses.diagnoser import Diagnoser

KNOWN = ("hinge_offset", "camera_shift", "added_mass")
STAGES = (
    "fitting the nominal model",
    "testing every effect",
    "refitting the strongest",
    "predicting what was held out",
)
STEPS = 3  # of each stage


class ToyDiagnoser(Diagnoser):
    """A diagnosis that takes no time."""

    def __init__(self, seconds: float = 0.0, gate: Callable[[int], None] | None = None) -> None:
        self.seconds, self.gate = seconds, gate
        self.starts = 0

    def check(self, spec: DiagnosisSpec, dataset: Dataset) -> None:
        for name in spec.suspects:
            if name not in KNOWN:
                raise ValueError(f"unknown suspect {name!r}; there are {', '.join(KNOWN)}")

    def diagnose(
        self, spec: DiagnosisSpec, dataset: AnyDataset, evaluator: Evaluator, rig: Rig | None = None
    ) -> Iterator[Progress]:
        self.starts += 1
        total = STEPS * len(STAGES)
        for done in range(total):
            if self.gate:
                self.gate(done)
            time.sleep(self.seconds)
            if spec.calibration.seed == UNLUCKY and done == 2:
                raise ArithmeticError("the thirteenth seed breaks")
            stage, known = f"{STAGES[done // STEPS]}, part {done % STEPS + 1}", partial(done) if done >= STEPS else None
            yield Progress((done + 1) / (total + 1), stage, 10 * done, partial=known)
        if self.gate:
            self.gate(total)
        yield Progress(1.0, "done", 10 * total, finding(spec, wing_or_vehicle(dataset)))

    def stored(self, finding: Finding) -> dict[str, Any]:
        return report.finding_json(finding)

    def html(self, stored: dict[str, Any]) -> str:
        return report.html(report.finding_from_json(stored))


def partial(done: int) -> PartialFinding:
    """Made up; hypotheses lead after ``done`` steps once the strongest are refitted."""
    refitted = done >= 2 * STEPS
    leads = (
        Lead(("hinge_offset",), "Hinge off its place", 0.9 if refitted else 0.7, refitted),
        Lead(("camera_shift",), "Camera shifted", 0.2, refitted=False),
    )
    places = (PlaceMisfit("1", "m", 1e-3, 0.02, 0.2), PlaceMisfit("2", "m", 3e-3, 0.08, 0.45))
    outline = ((-0.05, 0.0), (-0.05, 0.5), (0.1, 0.5), (0.1, 0.0))
    return PartialFinding("m", 0.5e-3, 2e-3, places, outline, leads, min(done - STEPS + 1, len(KNOWN)), len(KNOWN))


def finding(spec: DiagnosisSpec, dataset: Dataset) -> Finding:
    """Made up, and complete enough to be printed."""
    random = np.random.default_rng(spec.calibration.seed)
    share = float(random.uniform(0.8, 0.95))
    hypotheses = (
        _hypothesis("hinge_offset", "Hinge off its place", 0.9, 41.0, share),
        _hypothesis("camera_shift", "Camera shifted", 0.07, 12.0, 0.2),
        Hypothesis((), "Nominal model", "", "", "", 0.03, 0.0, 0.0, 0, 0.0, None, 2e-3, True),
    )
    before, after = Interval(2e-3, 1.8e-3, 2.2e-3), Interval(0.5e-3, 0.45e-3, 0.55e-3)
    return Finding(
        dataset=dataset.name,
        kind="tracks",
        unit="m",
        model=f"flexible wing, division {spec.calibration.division}",
        verdict="named",
        summary=f"The hinge is off its place. Started from {len(spec.start)} genes, considered {list(spec.suspects)}.",
        probabilities={"adequate": 0.03, "named": 0.9, "ambiguous": 0.04, "unnamed": 0.02, "measurement fault": 0.01},
        named=("hinge_offset",),
        added_effects=("hinge_offset",),
        strength=3.1,
        floors=Floors(0.5e-3, 0.3, None, "", 1e-5, 0.5e-3),
        hypotheses=hypotheses,
        indistinguishable=(("hinge_offset",), ("camera_shift",)),
        where=Where(
            "outer 30 % of the span, along z", Interval(0.85, 0.7, 1.0), None, None, "z", (0.1, 0.9),
            (Exponent("flap frequency", Interval(2.0, 1.8, 2.2), 2.0, 4.0, "Hz"),),
        ),
        markers=(
            MarkerMisfit("1", 0.4, 0.2, 0.02, 0.2, 1e-3, 0.2e-3, 0.25, (0.0, 0.0, 1.0)),
            MarkerMisfit("2", 0.9, 0.7, 0.08, 0.45, 3e-3, 0.3e-3, 0.5, (0.0, 0.0, 1.0)),
        ),
        phase_map=PhaseMap(
            (0.4, 0.9), (0.0, 0.25, 0.5, 0.75), ((1e-3, 2e-3, 1e-3, 0.0), (2e-3, 4e-3, 2e-3, 1e-3)),
            ((1e-4,) * 4, (2e-4,) * 4), 1e-4,
        ),
        missing=(
            MissingLoad(
                "slow", (0.3, 0.8), (0.0, 0.5), ((0.1, -0.1), (0.4, -0.5)), ((0.02, 0.02), (0.03, 0.03)), "N/m"
            ),
        ),
        recordings=(RecordingMisfit("slow", False, 3.0, 45.0, 100.0, 0.0, before, after, 0.5e-3),),
        proof=Proof(before, after, 0.5e-3, True, "held-out misfit falls to the floor"),
        overlays=(
            Overlay("slow", "2_z", False, (0.5, 0.0, 0.25), (3e-3, 1e-3, 2e-3), (0.0, 0.0, 0.0), (3e-3, 1e-3, 2e-3)),
        ),
        genes=(GeneValue("hinge_offset.z", "m", "height of the hinge", Interval(4e-3, 3.8e-3, 4.2e-3), 0.0),),
        law=None,
        advice=(
            Advice(
                "record at 4 Hz: hinge offset or camera shift would differ by 5 times the noise", 5.0, 0.9,
                ("hinge_offset", "camera_shift"), AdvisedCondition(4.0, 45.0, 100.0, 0.0, 0.0),
            ),
        ),
        outline=((0.0, 0.0), (0.0, 0.5), (0.1, 0.5), (0.1, 0.0)),
    )  # fmt: skip


def _hypothesis(name: str, title: str, probability: float, evidence: float, explained: float) -> Hypothesis:
    return Hypothesis(
        (name,), title, "actuation", "made up", "all markers move", probability, evidence, 2.0 * evidence, 1,
        explained, 0.9 * explained, 0.5e-3, True,
    )  # fmt: skip
