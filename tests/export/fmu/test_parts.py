"""The parts of an exported model, without compiling one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.oracles.exports.fmus import true_vehicle, true_wing
from wingfit.export.fmu.build import product_of
from wingfit.export.fmu.conditions import reference_condition
from wingfit.export.fmu.description import header, model_description
from wingfit.export.fmu.kernels.inputs import followed
from wingfit.export.fmu.memory import Memory, relocated
from wingfit.export.fmu.product import NotExportedError
from wingfit.export.fmu.vehicle_laws import DirectVehicle
from wingfit.records import Wing
from wingfit.sim.effects.registry import EFFECTS

_AT = np.linspace(0.0, 0.2, 2001)


def test_the_memory_has_each_array_once_and_knows_where_addresses_point() -> None:
    numbers, more = np.arange(5.0), np.arange(3)
    row = np.array([[5, numbers[2:].ctypes.data, more.ctypes.data, 0]])
    memory = Memory()
    memory.add((numbers, (numbers, row)), changing=False)
    memory.add(more, changing=True)
    block = np.frombuffer(memory.image())
    assert len(block) == memory.size == 24
    assert memory.first_changing == 16
    assert np.array_equal(block[:5], numbers)
    assert relocated(row, memory, (1, 2, 3)) == [(9, 2), (10, 16)]


def test_what_follows_an_input_solves_its_equation() -> None:
    value, rate, target, time = 3.0, 5.0, 4.0, 0.03
    f, f1, f2, f3, turned = (
        np.array(part) for part in zip(*(followed(value, rate, target, time, t) for t in _AT), strict=True)
    )
    assert f[0] == pytest.approx(value)
    assert f1[0] == pytest.approx(rate)
    assert np.allclose(f2, (target - f) / time**2 - 2.0 * f1 / time)
    for function, slope in ((f, f1), (f1, f2), (f2, f3), (turned, f)):
        assert np.allclose(np.gradient(function, _AT)[1:-1], slope[1:-1], rtol=1e-3, atol=1e-3 * np.abs(slope).max())
    assert followed(4.0, 0.0, 4.0, time, 0.1)[:4] == (4.0, 0.0, 0.0, 0.0)
    assert followed(3.0, 1.0, 4.0, 0.0, 0.1) == (4.0, 0.0, 0.0, 0.0, 0.4)


@pytest.mark.parametrize("name", [one.name for one in EFFECTS.values() if one.wing and not one.of_rods])
def test_every_effect_of_a_wing_can_be_exported(name: str) -> None:
    found = product_of(true_wing((name,), "4"), 96)
    assert "marker.m01.x" in [one.name for one in found.variables]
    assert len({number for _, number in found.laws}) == sum("law" in symbol for symbol in found.functions)


def test_effects_of_a_vehicle_are_direct_or_a_correction() -> None:
    names = ("clap_and_peel", "stroke_amplitude", "circulation_lag", "tail_lift")
    model = true_vehicle(names, ("clap_and_peel",))
    found = DirectVehicle(model, reference_condition(model))
    assert [one.name for one in found.effects] == ["stroke_amplitude", "clap_and_peel"]
    assert set(found.corrected) == {"circulation_lag", "tail_lift"}
    assert "circulation_lag" in found.remark


def test_texts_of_an_fmu_escape_names() -> None:
    model = true_vehicle()
    odd = replace(model, rig=replace(model.vehicle, name='a "<b>" & c'))
    product = product_of(odd, 1)
    assert 'modelName="wingfit_a___b_____c"' in model_description(odd, product, "0" * 64)
    assert "&lt;b&gt;" in model_description(odd, product, "0" * 64)
    assert "#define LIMIT_COUNT ((size_t)3)" in header(product, "0" * 64)


def test_a_rigid_wing_is_refused_with_the_remedy() -> None:
    model = true_wing((), "4")
    assert isinstance(model.rig, Wing)
    rigid = replace(model, rig=replace(model.rig, structure="rigid", rods=(), driven_rods=()))
    with pytest.raises(NotExportedError, match="structure: sheet"):
        product_of(rigid, 96)
