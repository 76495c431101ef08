"""The real engine behind the seam, on the Robird wing; searches and kills are in `test_kill_and_resume.py`."""

from __future__ import annotations

import pytest

from wingfit.calibration.search import CalibrationSpec
from wingfit.records import Dataset
from wingfit.service.runs.engine import Engine
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, vacuum

SPEC = CalibrationSpec(division="4", mode="joint")


@pytest.fixture(scope="module")
def dataset() -> Dataset:
    wing = robird_wing()
    recording = blank_recording(wing, vacuum(10.0, 0.0, 3.0), "still", frames=24)
    return Dataset("robird", wing, (recording,))


def test_the_standing_of_genes_is_in_the_order_and_units_of_the_model(dataset: Dataset) -> None:
    engine = Engine()
    nominal = engine.genome(SPEC, dataset, {})
    names = engine.gene_names(SPEC, dataset)
    assert tuple(nominal) == names
    changed = engine.genome(SPEC, dataset, {names[0]: nominal[names[0]] * 1.5})
    assert changed[names[0]] == pytest.approx(nominal[names[0]] * 1.5)
    assert {name: changed[name] for name in names[1:]} == {name: nominal[name] for name in names[1:]}


def test_a_value_out_of_bounds_names_gene_value_and_limits(dataset: Dataset) -> None:
    engine = Engine()
    name = engine.gene_names(SPEC, dataset)[0]
    value = engine.genome(SPEC, dataset, {})[name] * 6
    with pytest.raises(ValueError, match=f"'{name}' is .* must lie in"):
        engine.genome(SPEC, dataset, {name: value})
    wide = CalibrationSpec(division="4", bounds_factor=100.0)
    assert engine.genome(wide, dataset, {name: value})[name] == value


@pytest.mark.parametrize("division", ["5", "99", "99,99", "99x99"])
def test_an_impossible_division_is_a_value_error(dataset: Dataset, division: str) -> None:
    with pytest.raises(ValueError, match=f"division '{division}'"):
        Engine().gene_names(CalibrationSpec(division=division), dataset)


def test_a_specification_that_does_not_fit_is_a_value_error(dataset: Dataset) -> None:
    with pytest.raises(ValueError, match="unknown gene 'nope'; there are E_f"):
        Engine().check(CalibrationSpec(division="4", genes=("nope",)), dataset)
