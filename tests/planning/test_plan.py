"""Plans of a wing, a vehicle and a linear rig: standard errors in closed form, what is refused, what is proposed."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wingfit
from wingfit import CalibrationSpec, Channel, Gene, PlanSpec, Quantity, Rig, Run, Series, SeriesDataset
from wingfit.inference.campaign.responses import coefficients
from wingfit.records import Dataset

EXAMPLES = Path(__file__).parents[2] / "examples"
NOISE, SAMPLES = 0.05, 64
FEW = ("stroke_bias", "stroke_amplitude", "scale_error", "unit_error")


def line(genes: Any, run: Run) -> dict[str, Any]:
    return {"y": genes["a"] + genes["b"] * run.times * run.settings["slope"]}


def rig() -> Rig:
    return Rig(
        name="line",
        genes=[Gene("a", "1", 1.0, -100.0, 100.0), Gene("b", "1", 2.0, -100.0, 100.0)],
        channels={"y": "1"},
        settings={"slope": "1"},
        simulate=line,
        faults=False,
    )


def lines() -> SeriesDataset:
    times, rng = np.linspace(0.0, 1.0, SAMPLES), np.random.default_rng(5)
    recordings = tuple(
        Series(
            f"r{k}",
            times,
            (Channel("y", "1", NOISE),),
            (1.0 + 2.0 * times * slope + NOISE * rng.standard_normal(SAMPLES))[:, None],
            settings={"slope": slope},
        )
        for k, slope in enumerate((1.0, 3.0))
    )
    return SeriesDataset("lines", "line", recordings, (Channel("y", "1", NOISE),), settings=(Quantity("slope", "1"),))


def test_standard_errors_of_a_linear_rig_are_those_of_least_squares() -> None:
    found = wingfit.plan(lines(), PlanSpec(effects=None, add=1), rig=rig())
    times = np.linspace(0.0, 1.0, SAMPLES)
    slopes = np.vstack([np.column_stack([np.ones(SAMPLES), times * slope]) for slope in (1.0, 3.0)])
    exact = NOISE * np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    level = found.noise.deviation["y"] / NOISE
    errors = [one.standard_error for one in found.genes]
    np.testing.assert_allclose(errors, level * exact, rtol=0.35)  # the colour of the noise is estimated
    assert [one.name for one in found.genes] == ["a", "b"]
    assert all(one.identified for one in found.genes)


def test_more_repeats_are_worth_their_number() -> None:
    one, four = (wingfit.plan(lines(), PlanSpec(effects=None, add=0, beats=n), rig=rig()) for n in (1, 4))
    for a, b in zip(one.genes, four.genes, strict=True):
        assert b.standard_error == pytest.approx(0.5 * a.standard_error, rel=1e-3)


@pytest.fixture(scope="module")
def vehicle() -> wingfit.Plan:
    return wingfit.plan(EXAMPLES / "delfly", PlanSpec(effects=FEW, add=2))


def test_effects_that_look_the_same_are_confused(vehicle: wingfit.Plan) -> None:
    found = {frozenset((one.one, one.other)): one for one in vehicle.confused}
    alike = found[frozenset(("scale_error", "unit_error"))]
    assert alike.cosine == pytest.approx(1.0, abs=1e-6)
    assert alike.probability < 0.01
    assert frozenset(("stroke_bias", "stroke_amplitude")) not in found


def test_the_smallest_size_is_given_in_the_unit_of_the_effect(vehicle: wingfit.Plan) -> None:
    bias = next(one for one in vehicle.effects if one.name == "stroke_bias")
    (size,) = bias.sizes
    assert bias.smallest_part is not None
    assert size.smallest == pytest.approx(bias.smallest_part * size.typical)
    assert bias.detection_probability > 0.99
    assert bias.diagnosed_part is not None
    assert bias.diagnosed_part > bias.smallest_part


def test_additions_help(vehicle: wingfit.Plan) -> None:
    assert len(vehicle.for_genes) == len(vehicle.for_effects) == 2
    assert vehicle.for_genes[1].standard_error_factor < vehicle.for_genes[0].standard_error_factor < 1.0
    assert vehicle.for_effects[0].separation_factor >= 1.0


def test_a_description_without_recordings_is_planned_with_stated_noise(tmp_path: Path) -> None:
    shutil.copy(EXAMPLES / "delfly" / "dataset.yaml", tmp_path)
    spec = PlanSpec(effects=None, add=0, noise_mn=6.0, scatter_percent=0.0, zero_mn=0.0, beats=20)
    found = wingfit.plan(tmp_path, spec)
    double = wingfit.plan(tmp_path / "dataset.yaml", PlanSpec(**{**vars(spec), "noise_mn": 12.0}))
    assert found.noise.source == "stated"
    assert found.beats == 20
    for a, b in zip(found.genes, double.genes, strict=True):
        assert b.standard_error > a.standard_error
    assert found.as_dict()["genes"][0]["name"] == "C_l"


def test_a_wing_is_planned_from_its_description(tmp_path: Path) -> None:
    shutil.copy(EXAMPLES / "robird" / "dataset.yaml", tmp_path)
    calibration = CalibrationSpec(division="4", genes=("E_f", "D_E"), recordings=("vac-0010mbar-lag3-3.0hz",))
    spec = PlanSpec(calibration, ("stroke_bias",), add=0)
    all_markers = wingfit.plan(tmp_path, spec)
    few = wingfit.plan(tmp_path, PlanSpec(calibration, None, add=0, markers=6))
    assert (all_markers.markers, few.markers) == (49, 6)
    assert all(b.standard_error > a.standard_error for a, b in zip(all_markers.genes, few.genes, strict=True))
    half = next(one for one in all_markers.variants if (one.what, one.number) == ("beats", 1))
    assert half.standard_error_factor == pytest.approx(2.0, rel=0.05)
    (effect,) = all_markers.effects
    assert effect.smallest_part is not None
    assert effect.rival is None


def test_coefficients_keep_squares_and_products() -> None:
    values = np.random.default_rng(6).standard_normal((2, 17, 3))
    for part in (values, values[:, :16]):
        a, b = (coefficients(one) for one in part)
        np.testing.assert_allclose(a.T @ b, part[0].T @ part[1], atol=1e-12)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"noise_mn": -1.0}, "noise_mn is -1.0; give a number from 1e-06"),
        ({"beats": 0}, "beats is 0; give a whole number from 1"),
        ({"power": 1.0}, "power is 1.0; give a number from 0.5 to 0.999"),
        ({"add": True}, "add is True"),
        ({"noise_mm": float("nan")}, "noise_mm is nan"),
    ],
)
def test_impossible_settings_are_refused(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        PlanSpec(**settings)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"noise_mm": 0.4}, "noise_mm is a setting of marker tracks"),
        ({"effects": ("backlash",)}, "unknown suspect 'backlash'"),
        ({"genome": {"E_f": 1.0}}, "the genome has a gene 'E_f', which the model does not have"),
        ({"calibration": CalibrationSpec(genes=("E_f",))}, "unknown gene 'E_f'"),
    ],
)
def test_settings_that_do_not_fit_are_refused(settings: dict[str, Any], words: str) -> None:
    dataset = wingfit.load_dataset(EXAMPLES / "delfly")
    assert isinstance(dataset, Dataset)
    with pytest.raises(ValueError, match=words):
        wingfit.plan(dataset, PlanSpec(add=0, **settings))


def test_a_description_of_another_rig_is_refused(tmp_path: Path) -> None:
    shutil.copy(EXAMPLES / "pendulum" / "dataset.yaml", tmp_path)
    with pytest.raises(ValueError, match="needs the times and inputs of recordings"):
        wingfit.plan(tmp_path)
