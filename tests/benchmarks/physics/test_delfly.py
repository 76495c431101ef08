from __future__ import annotations

import json
from xml.etree import ElementTree

import numpy as np
import pytest

from benchmarks import delfly
from benchmarks.common.svg import Line, Panel, svg
from benchmarks.delfly import FINER_TRIAL, SMALL, Fitted, corners, coverage, fit, milliseconds, rows, table, widest
from wingfit.calibration.evaluator import Evaluator
from wingfit.records import LowPass
from wingfit.sim.filtering import low_passed
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.vehicle.terms import chosen
from wingfit.sim.virtual_rigs.balance import TRIALS, record, true_beat
from wingfit.sim.virtual_rigs.balance import delfly as vehicle
from wingfit.workers import make_evaluator


@pytest.fixture(scope="module")
def evaluator() -> Evaluator:
    return make_evaluator("in_process")


@pytest.fixture(scope="module")
def fitted(evaluator: Evaluator) -> dict[str, Fitted]:
    trial = TRIALS[FINER_TRIAL]
    raw = record(true_beat(vehicle(), trial), trial, SMALL, np.random.default_rng(0))
    models = {
        "proposed": BladeElementWing(vehicle()),
        "without_fling": BladeElementWing(vehicle(), chosen("proposed", ("clap_and_peel",))),
    }
    low = low_passed(raw, LowPass(40.0))
    return {name: fit(model, low, trial, evaluator) for name, model in models.items()}


def test_coefficients_are_recovered_and_the_missing_fling_is_located(fitted: dict[str, Fitted]) -> None:
    errors = fitted["proposed"].errors
    assert set(errors) == {"C_l", "C_r", "C_F"}
    assert all(abs(e) < 4 for e in errors.values())
    found = fitted["proposed"].estimate.values["C_l"]
    assert errors["C_l"] == pytest.approx(100 * (found / 1.24 - 1))
    assert (
        fitted["without_fling"].agreement["lift"].correlation < 0.95 < fitted["proposed"].agreement["lift"].correlation
    )


def test_rows_can_be_printed_and_written(fitted: dict[str, Fitted]) -> None:
    found = rows({name: [one] for name, one in fitted.items()})
    assert json.loads(json.dumps(found))[0]["condition"] == "test-4"
    assert "(1.24)" in table(found).splitlines()[1]


def test_range_is_the_union_and_none_if_one_is_missing() -> None:
    assert widest([(0.1, 0.3), (0.05, 0.2)]) == [0.05, 0.3]
    assert widest([(0.1, 0.3), None]) is None


def test_corners_that_end_elsewhere_are_counted(fitted: dict[str, Fitted], evaluator: Evaluator) -> None:
    one = fitted["proposed"]
    model = BladeElementWing(vehicle())
    assert corners(model, [one], evaluator) == 100.0
    one.estimate.values["C_l"] *= 1.01
    assert corners(model, [one], evaluator) == 0.0
    one.estimate.values["C_l"] /= 1.01


def test_intervals_are_counted(evaluator: Evaluator, monkeypatch: pytest.MonkeyPatch) -> None:
    model, beats = BladeElementWing(vehicle()), [true_beat(vehicle(), trial) for trial in TRIALS[:2]]
    for width, expected in ((100.0, 100.0), (1e-9, 0.0)):
        monkeypatch.setattr(delfly, "INTERVAL", width)
        assert set(coverage(model, beats, SMALL, 2, 1, evaluator).values()) == {expected}


def test_time_of_an_individual_is_positive() -> None:
    assert 0.001 < milliseconds(BladeElementWing(vehicle()), batch=4, rounds=1) < 50


def test_figures_are_drawings_that_hold_every_point() -> None:
    x = np.array([0.0, 0.37, 1.0])
    lines = (Line("a < b", x, 3 * x), Line("b", x, x - 2.2, crosses=True))
    root = ElementTree.fromstring(svg([Panel("p", "x", "y", lines, (0.2, 0.4))]))  # noqa: S314
    texts = [node.text for node in root.iter() if node.tag.endswith("text")]
    assert {"a < b", "p", "-4", "4", "1"} <= set(texts)
    paths = [node.attrib["d"] for node in root.iter() if node.tag.endswith("path")]
    assert paths[0].count("L") == 2
    assert paths[1].count("M") == 3
