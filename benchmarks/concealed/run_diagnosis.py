"""Runs the diagnosis as a user would: dataset on disk in, finding out. This module has no access to the answers."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

from wingfit.calibration.spec import CalibrationSpec
from wingfit.diagnosis import DiagnosisSpec, diagnose
from wingfit.diagnosis.finding import Finding
from wingfit.diagnosis.policy import POLICY, Policy
from wingfit.records import load_dataset, wing_or_vehicle
from wingfit.workers import make_evaluator


@dataclass(frozen=True)
class Task:
    """A diagnosis to run.

    ``trial``: label of the dataset; ``dataset``: its path; ``division``: discretisation of a wing's model, "" for a
    vehicle; ``without``: force terms that a vehicle's model omits; ``policy``: thresholds of the diagnosis;
    ``suspects``: considered, all if empty; ``exhaustive``: whether every pair of them is fitted;
    ``effects``: that the model has.
    """

    trial: str
    dataset: Path
    division: str
    without: tuple[str, ...]
    policy: Policy = POLICY
    suspects: tuple[str, ...] = ()
    exhaustive: bool = False
    effects: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """Result of a diagnosis; ``reason`` says why there is no finding, and is "" if there is one."""

    trial: str
    finding: Finding | None
    reason: str
    seconds: float


def run(task: Task) -> Outcome:
    """Run the diagnosis ``task`` in this process. An exception in it becomes the ``reason`` of the outcome."""
    start, finding, reason = time.perf_counter(), None, ""
    calibration = CalibrationSpec(without=task.without, effects=task.effects)
    if task.division:
        calibration = replace(calibration, division=task.division)
    evaluator = make_evaluator("in_process")
    spec = DiagnosisSpec(calibration, suspects=task.suspects, policy=task.policy, exhaustive=task.exhaustive)
    try:
        for progress in diagnose(wing_or_vehicle(load_dataset(task.dataset)), spec, evaluator):
            finding = progress.finding
        reason = "" if finding else "it ended without a finding"
    except Exception as error:  # a crash counts as a failed trial; the other trials continue
        finding, reason = None, f"{type(error).__name__}: {error}"
    finally:
        evaluator.close()
    return Outcome(task.trial, finding, reason, time.perf_counter() - start)
