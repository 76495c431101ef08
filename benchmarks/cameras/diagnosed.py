"""Diagnoses of wings from films alone: of a displaced hinge, and of lenses whose distortion is not calibrated."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.cameras.from_film import dataset_from_films
from benchmarks.cameras.renderer.presets import thesis_strobe
from wingfit import CalibrationSpec, DiagnosisSpec, Finding, diagnose
from wingfit.records import Dataset, DatasetError

HINGE, DISPLACED_M = "hinge_offset.y", 0.008
_COEFFICIENTS = ("k1", "k2", "p1", "p2")


def _hinge(folder: Path) -> dict[str, Any]:
    """Diagnose a wing whose hinge is displaced."""
    finding = _diagnosed(dataset_from_films(folder / "hinge", {HINGE: DISPLACED_M}, _say))
    millimetres = [None if value is None else round(1e3 * value, 3) for value in _genes(finding).get(HINGE, ())]
    return {
        "hinge_offset_named": "hinge_offset" in finding.named,
        "hinge_mm": millimetres or None,
        **_scores(finding),
    }


def _lens(folder: Path) -> dict[str, Any]:
    """Diagnose a wing as it was described, tracked by cameras from which the distortion of the lenses is left out."""
    dataset = dataset_from_films(folder / "lens", {}, _say, cameras="undistorted")
    finding, assumed = _diagnosed(dataset), _diagnosed(replace(dataset, cameras=()))
    lens, genes = thesis_strobe().film.cameras[0].distortion, _genes(finding)
    found = {name: genes.get(f"lens_distortion.{name}") for name in _COEFFICIENTS}
    rounded = {name: [None if v is None else round(v, 5) for v in one] for name, one in found.items() if one}
    return {
        "lens_distortion_named": list(finding.named) == ["lens_distortion"],
        "lens": rounded,
        "lens_true": dict(zip(_COEFFICIENTS, map(float, lens), strict=False)),
        **{f"lens_{key}": value for key, value in _scores(finding).items()},
        **{f"lens_without_stated_cameras_{key}": value for key, value in _scores(assumed).items()},
    }


def _pinhole(folder: Path) -> dict[str, Any]:
    """Diagnose the same films with cameras calibrated without distortion: poses and focal lengths are wrong too."""
    try:
        dataset = dataset_from_films(folder / "lens", {}, _say, cameras="pinhole")
    except DatasetError as error:
        return {"pinhole_lens_distortion_named": False, "pinhole_refused": str(error)}
    finding = _diagnosed(dataset)
    named = list(finding.named) == ["lens_distortion"]
    scores = {f"pinhole_{key}": value for key, value in _scores(finding).items()}
    return {"pinhole_lens_distortion_named": named, **scores}


DIAGNOSED: Mapping[str, Callable[[Path], dict[str, Any]]] = {
    "hinge": _hinge,
    "lens": _lens,
    "pinhole": _pinhole,
}
"""What is concealed, and a function that films it into a folder, or uses the films there, and diagnoses it."""


def _say(what: str) -> None:
    print(what, file=sys.stderr)


def _diagnosed(dataset: Dataset) -> Finding:
    return diagnose(dataset, DiagnosisSpec(CalibrationSpec(mode="joint")))


def _genes(finding: Finding) -> dict[str, tuple[float | None, ...]]:
    """Return value, lower and upper end of the 90 % interval of the genes of the best hypothesis."""
    return {gene.name: tuple(vars(gene.value).values()) for one in finding.hypotheses[:1] for gene in one.genes}


def _scores(finding: Finding) -> dict[str, Any]:
    return {
        "named": list(finding.named),
        "probabilities": {name: round(float(value), 4) for name, value in finding.probabilities.items()},
        "nominal_over_floor": max(round(one.before.value / one.floor, 3) for one in finding.recordings),
        "calibrated_over_floor": max(
            round(one.after.value / one.floor, 3) for one in finding.recordings if not one.held_out
        ),
        "held_out_over_floor": max(round(one.after.value / one.floor, 3) for one in finding.recordings if one.held_out),
        "noise_mm": round(1e3 * finding.floors.noise, 3),
    }
