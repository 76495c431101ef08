"""Calibrations of a user's rig: every method recovers the truth, resumes and shares its work with the same bits."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import wingfit
from tests.calibration.series.swing import NOISE, RIG, STARTS, TRUTH, dataset, recorded, three
from wingfit import CalibrationSpec, GeneResult, SeriesDataset, SeriesResult
from wingfit.calibration.preparation import prepare_rig
from wingfit.calibration.search import Generation, calibrate_prepared
from wingfit.calibration.summary import summarise_rig
from wingfit.records.array_types import Array
from wingfit.rigs.run import Run
from wingfit.workers import make_evaluator

HERE = make_evaluator("in_process")
SMALL = {"population": 20, "max_generations": 12}
METHODS: dict[str, dict[str, Any]] = {
    "auto": {},
    "gauss_newton": {},
    "genetic": {"finish": True},
    "cma_es": {"finish": True},
}


def spec(method: str = "gauss_newton", **changes: Any) -> CalibrationSpec:
    return replace(CalibrationSpec(**SMALL), method=method, **(METHODS.get(method, {}) | changes))  # type: ignore[arg-type]


def calibrated(data: SeriesDataset, one: CalibrationSpec | None = None, **options: Any) -> SeriesResult:
    found = wingfit.calibrate(data, one or spec(), rig=options.pop("rig", RIG), **options)
    assert isinstance(found, SeriesResult)
    return found


def genes(found: SeriesResult) -> dict[str, GeneResult]:
    return {gene.name: gene for gene in found.genes}


def distance(gene: GeneResult, truth: float) -> float:
    """Difference from the truth in standard errors."""
    assert gene.absolute_error is not None
    return abs(gene.best - truth) / gene.absolute_error


def generations(one: CalibrationSpec, checkpoint: dict[str, Any] | None = None) -> list[Generation]:
    return list(calibrate_prepared(prepare_rig(one, RIG, three()), HERE, checkpoint))


@pytest.mark.parametrize("method", METHODS)
def test_every_method_recovers_the_truth(method: str) -> None:
    found = calibrated(three(), spec(method))
    own = genes(found)
    for name, truth in {**TRUTH, "start[a]": STARTS["a"], "start[b]": STARTS["b"], "speed[a]": 0.1}.items():
        assert distance(own[name], truth) < 3.5, name
    assert found.covariance is not None
    for name, row, k in zip(found.covariance.names, found.covariance.matrix, range(len(own)), strict=False):
        assert row[k] == pytest.approx((own[name].absolute_error or 0.0) ** 2)
        assert own[name].searched
    assert own["stiffness"].absolute_error == pytest.approx(0.02, rel=0.5)
    assert own["stiffness"].identifiable
    assert found.relative_to == "noise"
    assert found.before is not None
    assert found.after == pytest.approx(1.0, abs=0.1)
    assert found.before > 30.0
    assert not [one for one in found.remarks if "start[c]" not in one]


def test_auto_is_the_default_and_reports_progress() -> None:
    steps: list[float] = []
    found = calibrated(three(), CalibrationSpec(population=20), on_progress=lambda part, _: steps.append(part))
    assert steps == sorted(steps)
    assert steps[-1] == 1.0
    assert genes(found)["stiffness"].best == pytest.approx(TRUTH["stiffness"], rel=0.01)


def test_a_search_that_ends_early_says_so() -> None:
    found = calibrated(three(), spec("genetic", finish=False, max_generations=1))
    assert any("ended before the minimum" in one and "use method 'auto'" in one for one in found.remarks)


@pytest.mark.parametrize("method", METHODS)
def test_it_is_deterministic_and_resumes_with_the_same_bits(method: str) -> None:
    whole = generations(spec(method))
    middle = len(whole) // 2
    resumed = generations(spec(method), json.loads(json.dumps(whole[middle].checkpoint)))
    assert resumed == whole[middle + 1 :]
    ready = prepare_rig(spec(method), RIG, three())
    results = [summarise_rig(ready, RIG, three(), HERE, one[-1].checkpoint) for one in (whole, resumed)]
    assert results[0] == results[1]


def test_fixing_a_gene_of_one_recording_leaves_those_of_others_free() -> None:
    """Held-out recording c starts elsewhere than a, whose start is known."""
    fixed = {"start[a]": STARTS["a"], "speed[a]": 0.1, "start[b]": STARTS["b"], "speed[b]": 0.1}
    found = calibrated(three(estimates={}), spec(fixed=fixed))
    assert found.held_out_after == pytest.approx(1.0, abs=0.2)
    assert genes(found)["start[c]"].best == pytest.approx(STARTS["c"], abs=0.002)


def test_two_processes_give_the_same_bits() -> None:
    assert calibrated(three(), spec("auto"), workers=2) == calibrated(three(), spec("auto"))


def test_channels_are_compared_in_their_units() -> None:
    found = calibrated(three())
    one = found.recordings[0]
    assert (one.name, one.fitted, one.held_out) == ("a", True, False)
    for channel, noise in zip(one.channels, NOISE, strict=True):
        assert channel.noise == noise
        assert channel.samples == 80
        assert channel.before is not None
        assert channel.after == pytest.approx(noise, rel=0.3)
        assert channel.before > 10.0 * noise
    assert [channel.unit for channel in one.channels] == ["m", "m/s"]


def test_a_recording_that_was_not_fitted_gets_its_own_genes_alone() -> None:
    far = three()
    far = replace(far, recordings=(*far.recordings[:2], replace(far.recordings[2], estimates={"start": -0.2})))
    for method in ("gauss_newton", "auto"):
        found = calibrated(far, spec(method))
        own, other = genes(found)["start[c]"], found.recordings[2]
        assert (own.searched, own.nominal) == (False, -0.2)
        assert own.best == pytest.approx(STARTS["c"], abs=2e-3)
        assert (other.fitted, other.held_out) == (False, True)
        assert found.held_out_after == other.after == pytest.approx(1.0, abs=0.15)
        assert found.held_out_before is not None
        assert found.held_out_before > 30.0
        assert any(one.startswith("start[c], speed[c]: fitted to the recording alone") for one in found.remarks)


def test_a_recording_that_is_left_out_is_compared_but_not_held_out() -> None:
    found = calibrated(three(), spec(recordings=("a",)))
    assert [one.fitted for one in found.recordings] == [True, False, False]
    assert [one.held_out for one in found.recordings] == [False, False, True]
    assert not genes(found)["start[b]"].searched
    assert found.recordings[1].after == pytest.approx(1.0, abs=0.15)


def test_fixed_genes_of_a_recording_stay() -> None:
    fixed = {"start[c]": 0.13, "speed[a]": 0.1}
    own = genes(calibrated(three(), spec(fixed=fixed)))
    assert (own["start[c]"].best, own["speed[a]"].best) == (0.13, 0.1)
    assert not own["speed[a]"].searched
    own = genes(calibrated(three(), spec(genes=("stiffness", "damping"))))
    assert own["start[a]"].best == own["start[a]"].nominal
    assert own["start[c]"].best == own["start[c]"].nominal


@pytest.mark.parametrize("method", ["auto", "gauss_newton"])
def test_a_suspect_is_fitted_as_an_effect(method: str) -> None:
    creeping = three(added={"creep.rate": 0.02})
    without = calibrated(creeping, spec(method))
    assert without.after is not None
    assert without.after > 3.0
    assert any("beyond the noise: position" in one and "wingfit diagnose" in one for one in without.remarks)
    assert not any(gene.identifiable for gene in without.genes)
    found = calibrated(creeping, spec(method, effects=("creep",)))
    assert distance(genes(found)["creep.rate"], 0.02) < 3.5
    assert found.after == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("rate", [3.0, 8.0, 15.0])
def test_gauss_newton_starts_a_suspect_where_it_lowers_the_misfit(rate: float) -> None:
    """From its nominal rate of 5 rad/s it ends in another minimum."""
    found = calibrated(three(added={"hum.size": 0.01, "hum.rate": rate}), spec(effects=("hum",), fixed=TRUTH))
    assert genes(found)["hum.rate"].best == pytest.approx(rate, rel=0.02)
    assert found.after == pytest.approx(1.0, abs=0.1)


def test_a_suspect_may_have_the_name_of_an_effect_of_a_wing() -> None:
    tethered = three(added={"tether.k": 10.0, "tether.station": 0.8})
    found = calibrated(tethered, spec(effects=("tether",), fixed={"stiffness": TRUTH["stiffness"]}))
    own = genes(found)
    assert own["tether.k"].best * own["tether.station"].best ** 2 == pytest.approx(6.4, rel=0.02)
    assert any("tether.k and tether.station compensate each other" in one for one in found.remarks)


def test_a_fault_is_fitted_as_an_effect() -> None:
    shifted = three()
    shifted = replace(
        shifted, recordings=tuple(replace(one, values=one.values + np.array([0.02, 0.0])) for one in shifted.recordings)
    )
    found = genes(calibrated(shifted, spec(effects=("offset.position",))))
    (offset,) = (gene for name, gene in found.items() if name.startswith("offset.position"))
    assert distance(offset, 0.02) < 3.5


def test_an_effect_that_is_switched_off_is_remarked() -> None:
    found = calibrated(three(), spec(effects=("creep",), fixed={"stiffness": 55.0}))
    assert not any("switched off" in one for one in found.remarks)
    ready = prepare_rig(spec(effects=("creep",)), RIG, three())
    last = list(calibrate_prepared(ready, HERE))[-1].checkpoint
    off = last | {"found": {"joint": last["found"]["joint"] | {"creep.rate": 0.0}}}
    result = summarise_rig(ready, RIG, three(), HERE, off)
    assert "effect 'creep' is switched off in the best genome" in result.remarks


def test_uneven_times_and_gaps() -> None:
    rng = np.random.default_rng(5)
    uneven = np.sort(rng.uniform(0.0, 3.0, 150))
    recordings = [recorded("a", times=uneven), recorded("b"), recorded("c")]
    for one in recordings[:2]:
        one.values[10:25, 0] = np.nan
        one.values[rng.integers(0, 80, 12), 1] = np.nan
    recordings[1].values[:, 1] = np.nan
    found = calibrated(dataset(*recordings, held_out=("c",)), spec("auto"))
    for name, truth in TRUTH.items():
        assert distance(genes(found)[name], truth) < 3.5, name
    empty = found.recordings[1].channels[1]
    assert (empty.samples, empty.before, empty.after) == (0, None, None)
    assert found.recordings[0].channels[0].samples == 135
    assert found.after == pytest.approx(1.0, abs=0.15)


def test_the_scale_of_a_channel_does_not_matter() -> None:
    """The same data in millimetres."""
    data = three()

    def in_millimetres(values: Mapping[str, float], run: Run) -> Mapping[str, Array]:
        found = RIG.simulate(values, run)
        return {"position": 1e3 * found["position"], "speed": found["speed"]}

    rig = replace(RIG, channels={"position": "mm", "speed": "m/s"}, simulate=in_millimetres)
    channels = (wingfit.Channel("position", "mm", 1.0), data.channels[1])
    recordings = tuple(replace(one, quantities=channels, values=one.values * [1e3, 1.0]) for one in data.recordings)
    small = calibrated(replace(data, channels=channels, recordings=recordings), rig=rig)
    large = calibrated(data)
    for name in TRUTH:
        assert genes(small)[name].best == pytest.approx(genes(large)[name].best, rel=1e-6)
        assert genes(small)[name].absolute_error == pytest.approx(genes(large)[name].absolute_error, rel=1e-4)
    assert small.before == pytest.approx(large.before, rel=1e-9)
