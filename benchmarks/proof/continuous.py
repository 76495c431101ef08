"""The study of a continuous wing: a rod in finite elements, described as carefully as a laboratory can.

The wing is no multi-body model, the rest positions of its markers are measured by hand to 0.7 mm along each axis, and
its densities are known to 3 %. Its axis is displaced. The diagnosis should find that, and not take the errors of the
description for physics. Its model has eight rigid strips, because ribs keep the wing's sections from bending.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.concealed.benches.continuous import ContinuousBench
from benchmarks.concealed.plant.law import Concealed
from benchmarks.concealed.rigs import as_described
from benchmarks.concealed.trials import ROD, Build
from benchmarks.proof.robird import AT_FLOOR, Campaign, filmed
from benchmarks.proof.story import Claim, Story, beside_truth, diagnosed, leader, nominal_misfit, over_floor, saved
from wingfit.diagnosis.finding import Finding

BY_HAND = 7e-4  # m: standard deviation of rest positions along each axis
DIVISION = "8x1"
HIDDEN: Concealed = {"hinge_offset": {"strength": 0.012, "direction": -0.8}}  # m, rad from y to z
NEAR = 2e-3  # m: largest error of the displacement


def campaign(seed: int, hidden: Concealed = HIDDEN) -> Campaign:
    """Film the wing with random moduli under the conditions of the Robird study, reproducibly from ``seed``."""
    bench = ContinuousBench(Build("wing", DIVISION, ROD))
    made = filmed("continuous", bench, seed, hidden)
    wing = as_described(bench.rig, np.random.default_rng([seed, 4]), BY_HAND)
    return replace(made, dataset=replace(made.dataset, rig=wing))


def play(folder: Path, seed: int, workers: int) -> Story:
    """Run the study: film the wing, diagnose; write dataset and report to ``folder``."""
    made = campaign(seed)
    finding, page = diagnosed(saved(made.dataset, folder), {"division": DIVISION}, workers)
    return story_of(made, finding, page)


def story_of(made: Campaign, finding: Finding, page: Path) -> Story:
    """Figures, text and claims of the study from campaign and diagnosis; ``page``: path of the report."""
    best, floors = leader(finding), over_floor(finding)
    rows = beside_truth({gene.name: gene for gene in finding.genes}, made.truth)
    errors = [abs(row["found"] - row["true"]) for row in rows if row["found"] is not None]
    after = floors["heldout_over_floor"]
    remark = next((one for one in finding.remarks if "rest positions" in one), "")
    figures: dict[str, Any] = {
        "by_hand_mm": 1e3 * BY_HAND,
        "division": DIVISION,
        "model": finding.model,
        "verdict": finding.verdict,
        "probability": finding.probabilities[finding.verdict],
        "named": list(finding.named),
        "hidden": sorted(HIDDEN),
        "genes": rows,
        "refitted_rms_mm": 1e3 * nominal_misfit(finding),
        "found_rms_mm": 1e3 * best.misfit,
        "noise_rms_mm": 1e3 * finding.floors.noise,
        **floors,
        "remark": remark,
        "diagnosis_seconds": finding.seconds,
    }
    claims = (
        Claim(
            "it names the displaced axis and nothing else",
            finding.verdict == "named" and set(finding.named) == set(HIDDEN),
        ),
        Claim(f"and finds it to {1e3 * NEAR:g} mm", len(errors) == len(rows) and max(errors, default=1.0) < NEAR),
        Claim("it notices that rest positions are wrong", bool(remark)),
        Claim("the held-out misfit falls to the floor", after is not None and after <= AT_FLOOR),
    )
    lines = (
        f"diagnosis, {finding.seconds:.0f} s: {finding.verdict}: {', '.join(finding.named) or 'nothing'}",
        finding.summary,
        *(f"  {row['gene']:16} true {1e3 * row['true']:+.2f} mm   estimated {_mm(row['found'])}" for row in rows),
        remark,
    )
    return Story(figures, lines, claims, page)


def _mm(metres: float | None) -> str:
    return "nothing" if metres is None else f"{1e3 * metres:+.2f} mm"
