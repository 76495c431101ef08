"""Calibration and diagnosis of wings without rods: what is estimated, and what is refused because it cannot be."""

from __future__ import annotations

import math

import pytest

import wingfit
from tests.sim.wing.without_rods import animal, nominal, recorded
from wingfit.calibration.preparation import prepare
from wingfit.sim.wing.flexible_wing import FlexibleWing


def test_the_stiffness_of_a_sheet_is_estimated() -> None:
    model = FlexibleWing(animal("sheet"), "4")
    truth = 1.3 * 6e7
    spec = wingfit.CalibrationSpec(division="4", mode="joint", method="gauss_newton", genes=("E_f",), max_generations=6)
    found = {gene.name: gene for gene in wingfit.calibrate(recorded(model, nominal(model, E_f=truth)), spec).genes}
    assert math.isclose(found["E_f"].best, truth, rel_tol=0.01)
    assert found["E_f"].identifiable


def test_what_has_no_influence_is_refused() -> None:
    sheet, rigid = (
        recorded(model, nominal(model)) for model in (FlexibleWing(animal(s), "4") for s in ("sheet", "rigid"))
    )
    with pytest.raises(ValueError, match="gene 'E_r' has no influence on a wing with structure 'sheet'"):
        prepare(wingfit.CalibrationSpec(division="4", genes=("E_f", "E_r")), sheet)
    assert "E_r" not in prepare(wingfit.CalibrationSpec(division="4", mode="joint"), sheet).searched
    with pytest.raises(ValueError, match=r"nothing to calibrate: the wing is rigid, .* include an effect of the drive"):
        prepare(wingfit.CalibrationSpec(division="4"), rigid)


def test_a_rigid_wing_is_calibrated_and_diagnosed_by_effects_of_its_drive() -> None:
    model = FlexibleWing(animal("rigid"), "4", effects=("stroke_amplitude", "hinge_offset"))
    dataset = recorded(model, nominal(model, stroke_amplitude_part=0.1, hinge_offset_z=0.02))
    nominal_model = wingfit.CalibrationSpec(
        division="4", mode="joint", method="gauss_newton", effects=("stroke_amplitude",)
    )
    finding = wingfit.diagnose(dataset, wingfit.DiagnosisSpec(nominal_model))
    assert finding.verdict == "named"
    assert finding.named == ("hinge_offset",)
    genes = {gene.name: gene.value for gene in finding.genes}
    assert math.isclose(genes["hinge_offset.z"].value, 0.02, rel_tol=0.01)
    assert math.isclose(genes["stroke_amplitude.part"].value, 0.1, rel_tol=0.02)
