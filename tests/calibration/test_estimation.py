from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest

from wingfit.calibration.forces.disagreement import disagreements
from wingfit.calibration.forces.estimation import compare_forces, predict, summarise_forces
from wingfit.calibration.forces.result import ForceResult
from wingfit.calibration.preparation import prepare
from wingfit.calibration.search import CalibrationSpec, calibrate
from wingfit.records import Dataset, LowPass, Recording
from wingfit.sim.virtual_rigs.balance import DRAG, EXAMPLE, HELD_OUT, TRIALS, Balance, campaign, true_beat
from wingfit.workers import make_evaluator

LOCAL = CalibrationSpec(mode="local")
JOINT = CalibrationSpec(mode="joint")
OFFSET_AND_BIAS = ("balance_offset.x", "stroke_bias.angle")


@pytest.fixture(scope="module")
def dataset() -> Dataset:
    return campaign(1, EXAMPLE, held_out=HELD_OUT)


def run(spec: CalibrationSpec, dataset: Dataset) -> tuple[dict[str, Any], ForceResult]:
    evaluator = make_evaluator("in_process")
    *_, last = calibrate(spec, dataset, evaluator)
    return last.checkpoint, summarise_forces(spec, dataset, evaluator, last.checkpoint)


@pytest.fixture(scope="module")
def local(dataset: Dataset) -> ForceResult:
    return run(LOCAL, dataset)[1]


def test_each_recording_has_its_estimate_with_its_error(local: ForceResult) -> None:
    assert [e.name for e in local.estimates] == [t.name for t in TRIALS if t.name not in HELD_OUT]
    true = {trial.name: trial.coefficients for trial in TRIALS}
    off = [
        (e.values[name] - true[e.name][name]) / e.standard_errors[name] for e in local.estimates for name in e.values
    ]
    assert all(e.converged for e in local.estimates)
    assert np.sqrt(np.mean(np.square(off))) < 3
    assert all(np.allclose(np.diag(e.correlation), 1) for e in local.estimates)
    assert all(0 < e.noise[0][0][0] < 0.02**2 for e in local.estimates)


def test_before_and_after(local: ForceResult, dataset: Dataset) -> None:
    scatter = 0.012  # N: what the balance leaves
    assert local.before > 0.03 > scatter > local.after
    assert local.held_out_before is not None
    assert local.held_out_after is not None
    assert local.held_out_before > 0.03 > scatter > local.held_out_after
    assert run(LOCAL, replace(dataset, held_out=()))[1].held_out_after is None


def test_sources_of_each_recording(local: ForceResult) -> None:
    for trial in TRIALS:
        sources = {a.source for a in local.agreements if a.recording == trial.name}
        own = set() if trial.name in HELD_OUT else {"local"}
        assert sources == {"nominal", "global", "average"} | own
    quantities = [a.quantity for a in local.agreements if a.recording == "test-1" and a.source == "local"]
    assert sorted(quantities) == ["drag", "lift", "x", "z"]


def test_global_model_predicts_what_it_has_not_seen(local: ForceResult) -> None:
    assert local.global_model is not None
    assert local.global_model.recordings == tuple(e.name for e in local.estimates)
    lift = {(a.recording, a.source): a for a in local.agreements if a.quantity == "lift"}
    for name in HELD_OUT:
        assert lift[name, "global"].rmse_percent < 5 < lift[name, "nominal"].rmse_percent
    unseen = {a.recording: a for a in local.left_out if a.quantity == "lift"}
    assert set(unseen) == {e.name for e in local.estimates}
    assert np.mean([a.rmse for a in unseen.values()]) > np.mean([lift[name, "global"].rmse for name in unseen])


def test_genes_carry_the_mean_and_the_largest_error_or_how_far_the_estimates_lie_apart(local: ForceResult) -> None:
    genes = {gene.name: gene for gene in local.genes}
    assert genes["C_l"].best == pytest.approx(np.mean([e.values["C_l"] for e in local.estimates]))
    apart = disagreements(local.estimates)
    assert {"C_l", "C_F"} < set(apart)  # each condition has a C_l and a C_F of its own
    for name, gene in genes.items():
        if name in apart:
            assert gene.absolute_error == pytest.approx(np.std([e.values[name] for e in local.estimates], ddof=1))
        elif gene.searched:
            assert gene.absolute_error == pytest.approx(max(e.standard_errors[name] for e in local.estimates))
    assert not genes["C_l"].identifiable
    assert local.remarks[0].startswith("the 6 local estimates of C_l disagree")
    assert not genes["C_D0"].searched
    assert genes["C_D0"].standard_error is None


def test_joint_has_one_estimate_for_all(dataset: Dataset) -> None:
    _, result = run(JOINT, dataset)
    assert [e.name for e in result.estimates] == ["joint"]
    assert result.global_model is None
    assert {a.source for a in result.agreements} == {"nominal", "joint"}
    assert result.held_out_after is not None
    assert result.before > result.after


def test_without_enough_conditions_there_is_no_law_and_it_is_said(dataset: Dataset) -> None:
    _, result = run(replace(LOCAL, recordings=("test-1", "test-5", "test-8")), dataset)
    assert result.global_model is None
    assert result.left_out == ()
    assert any(
        remark.startswith("no global model: a law in flap frequency and body pitch needs at least 4")
        for remark in result.remarks
    )
    held_out = [a for a in result.agreements if a.recording == "test-3"]
    assert {a.source for a in held_out} == {"nominal", "average"}


def test_extrapolated_recordings_are_named(dataset: Dataset) -> None:
    _, result = run(LOCAL, replace(dataset, held_out=("test-8",)))
    assert any(
        r.startswith("recording 'test-8': flap frequency 10.3 Hz is outside [11.7, 13.3]") for r in result.remarks
    )


def test_a_law_outside_its_box_is_held_at_it_for_recordings_as_for_predictions(dataset: Dataset) -> None:
    fast = [
        replace(r, condition=replace(r.condition, flap_frequency=20.0)) if r.name == "test-3" else r
        for r in dataset.recordings
    ]
    _, result = run(LOCAL, replace(dataset, recordings=tuple(fast), held_out=("test-3",)))
    unseen = {a.source: a for a in result.agreements if a.recording == "test-3" and a.quantity == "x"}
    assert set(unseen) == {"nominal", "global", "average"}
    assert result.held_out_after == pytest.approx(unseen["global"].rmse, rel=0.1)
    assert result.held_out_after != pytest.approx(unseen["average"].rmse, rel=0.1)
    assert any(r.startswith("recording 'test-3': the global model gives C_l = -") for r in result.remarks)
    assert result.global_model is not None
    found = predict(LOCAL, dataset, result.global_model, fast[2].condition)
    assert {f"recording 'test-3': {remark}" for remark in found.remarks} <= set(result.remarks)


def test_left_out_laws_say_where_they_extrapolate(local: ForceResult, dataset: Dataset) -> None:
    said = [r for r in local.remarks if r.startswith("recording 'test-8' left out: ")]
    assert [r.split(": ")[1].split(" is outside")[0] for r in said] == [
        "flap frequency 10.3 Hz",
        "body pitch 31 deg",
        "airspeed 2 m/s",
    ]
    assert not any("'test-4' left out" in r for r in local.remarks)  # amid the others
    four = tuple(e.name for e in local.estimates[:4])
    _, few = run(replace(LOCAL, recordings=four), dataset)
    assert few.left_out == ()
    assert sum(r.startswith("with a recording left out: no global model: a law in") for r in few.remarks) == 1
    assert len(set(few.remarks)) == len(few.remarks)


BASE = campaign(1, Balance(every=20, beats=5), TRIALS[2:])


def each(change: Callable[[Recording], Recording]) -> Dataset:
    return replace(BASE, recordings=tuple(change(r) for r in BASE.recordings))


def steady(value: float, axis: slice = slice(None)) -> Dataset:
    def change(r: Recording) -> Recording:
        values = r.values.copy()
        values[:, axis] = value
        return replace(r, values=values)

    return each(change)


def stretch(first: float, last: float, every: int = 1) -> Dataset:
    """The samples between two instants, in beats."""

    def change(r: Recording) -> Recording:
        beats = r.times * r.condition.flap_frequency
        kept = np.flatnonzero((beats >= first - 1e-9) & (beats < last - 1e-9))[::every]
        return replace(r, times=r.times[kept], values=r.values[kept])

    return each(change)


def broken(every: int, axis: slice = slice(None)) -> Dataset:
    def change(r: Recording) -> Recording:
        values = r.values.copy()
        values[every - 1 :: every, axis] = np.nan
        return replace(r, values=values, low_pass=LowPass(40.0))

    return each(change)


def only(axis: Literal["x", "z"]) -> Dataset:
    return each(lambda r: replace(r, forces=(axis,), values=r.values[:, ["xz".index(axis)]]))


X, Z = slice(0, 1), slice(1, 2)
RAW = replace(LOCAL, low_pass=0.0)
BOTH = replace(LOCAL, axes=("x", "z"))
NO_BEAT = "holds no whole beat without a gap"


@pytest.mark.parametrize(
    ("dataset", "spec", "refused"),
    [
        pytest.param(steady(0.0, Z), LOCAL, None, id="no z"),
        pytest.param(steady(0.05, Z), BOTH, None, id="constant z, fitted"),
        pytest.param(steady(0.05, Z), JOINT, None, id="constant z, joint"),
        pytest.param(steady(0.0, X), LOCAL, None, id="no x"),
        pytest.param(steady(0.0), BOTH, None, id="nothing"),
        pytest.param(steady(0.03), LOCAL, None, id="constant"),
        pytest.param(stretch(0, 1), LOCAL, None, id="one beat"),
        pytest.param(stretch(0, 1), RAW, None, id="one beat, raw"),
        pytest.param(stretch(0.5, 5), LOCAL, None, id="from the middle of a beat"),
        pytest.param(stretch(0.5, 1.7), LOCAL, NO_BEAT, id="parts of beats"),
        pytest.param(stretch(0, 5, every=13), RAW, None, id="four samples a beat"),
        pytest.param(stretch(0, 5, every=80), RAW, None, id="less than one sample a beat"),
        pytest.param(broken(120), LOCAL, None, id="some gaps"),
        pytest.param(broken(7), LOCAL, NO_BEAT, id="gaps in every beat"),
        pytest.param(broken(7, Z), LOCAL, NO_BEAT, id="gaps in z"),
        pytest.param(broken(7), replace(LOCAL, recordings=("test-4",)), NO_BEAT, id="gaps in what is not fitted"),
        pytest.param(replace(broken(7), held_out=("test-4",)), LOCAL, NO_BEAT, id="gaps in what is held out"),
        pytest.param(only("x"), LOCAL, None, id="x only"),
        pytest.param(only("z"), replace(LOCAL, axes=("z",)), None, id="z only"),
        pytest.param(only("z"), LOCAL, "force axis 'x' is to be fitted", id="z only, x fitted"),
        pytest.param(replace(BASE, recordings=BASE.recordings[:1]), LOCAL, None, id="one recording"),
        pytest.param(
            replace(BASE, recordings=(*BASE.recordings, *(replace(r, name=f"{r.name}b") for r in BASE.recordings))),
            LOCAL,
            None,
            id="every condition twice",
        ),
        pytest.param(replace(steady(0.0, Z), held_out=("test-7",)), LOCAL, None, id="no z in what is held out"),
    ],
)
def test_whatever_is_accepted_can_be_judged(dataset: Dataset, spec: CalibrationSpec, refused: str | None) -> None:
    if refused is not None:
        with pytest.raises(ValueError, match=refused):
            prepare(spec, dataset)
        return
    _, result = run(spec, dataset)
    assert {a.recording for a in result.agreements} == {r.name for r in dataset.recordings}
    assert np.isfinite([a.rmse for a in (*result.agreements, *result.left_out)]).all()
    assert np.isfinite([result.before, result.after]).all()
    name = dataset.recordings[0].name
    shown = compare_forces(spec, dataset, name, "nominal", {})
    assert all(np.isfinite(series).all() for series in shown.modelled.values())
    assert len(shown.frequency) > 1


def test_comparison_filters_both_alike(dataset: Dataset) -> None:
    true = TRIALS[3].coefficients | DRAG
    checkpoint, _ = run(replace(LOCAL, recordings=("test-4",)), dataset)
    genome = checkpoint["found"]["test-4"] | true
    found = compare_forces(LOCAL, dataset, "test-4", "local", genome)
    above = found.frequency > 120
    assert found.modelled_spectrum["x"][above].max() < 1e-6 * found.modelled_spectrum["x"].max()
    assert found.recorded_spectrum["x"][above].max() < 1e-4 * found.recorded_spectrum["x"].max()
    np.testing.assert_allclose(found.modelled["x"], found.recorded["x"], atol=0.01)
    raw = compare_forces(replace(LOCAL, low_pass=0.0), dataset, "test-4", "local", genome)
    assert np.ptp(raw.modelled["x"]) > 1.05 * np.ptp(found.modelled["x"])


def test_prediction_of_a_condition(local: ForceResult, dataset: Dataset) -> None:
    assert local.global_model is not None
    trial = TRIALS[2]
    found = predict(LOCAL, dataset, local.global_model, trial.condition, points=100)
    true = true_beat(dataset.vehicle, trial)[:, 0]
    assert found.remarks == ()
    assert found.forces["x"].mean() == pytest.approx(true.mean(), rel=0.03)
    assert np.corrcoef(found.forces["x"], true[::16])[0, 1] > 0.98
    far = replace(trial.condition, flap_frequency=20.0)
    beyond = predict(LOCAL, dataset, local.global_model, far)
    assert beyond.values["C_l"] == 0.0
    assert any("flap frequency 20 Hz is outside" in remark for remark in beyond.remarks)
    assert any("gives C_l = -" in remark and "0 is taken" in remark for remark in beyond.remarks)


def test_the_headline_is_the_root_mean_square_of_all_samples(dataset: Dataset) -> None:
    found = run(JOINT, dataset)[1]
    by_recording = [a for a in found.agreements if (a.source, a.quantity) == ("joint", "x")]
    each = np.array([a.rmse for a in by_recording if a.recording not in HELD_OUT])
    assert found.after == pytest.approx(float(np.sqrt(np.mean(each**2))), rel=0.05)  # recordings of nearly equal length
    assert found.after > 1.1 * each.mean()


def test_a_model_that_lacks_something_tells_no_coefficient(dataset: Dataset, local: ForceResult) -> None:
    assert not any("misses physics" in remark for remark in local.remarks)
    assert [g.name for g in local.genes if g.identifiable] == ["C_r"]
    poorer = run(replace(LOCAL, without=("clap_and_peel",)), dataset)[1]
    said = [remark for remark in poorer.remarks if "misses physics" in remark]
    assert len(said) == 6
    assert "times the scatter from beat to beat" in said[0]
    assert not any(g.identifiable for g in poorer.genes)


def test_a_low_pass_that_was_not_applied_is_said(dataset: Dataset) -> None:
    filtered = replace(dataset.recordings[0], low_pass=LowPass(100.0))
    mixed = replace(dataset, recordings=(filtered, *dataset.recordings[1:]))
    said = run(replace(LOCAL, low_pass=60.0), mixed)[1].remarks
    assert any("'test-1' says that it has been low-passed at 100 Hz; 60 Hz was not applied" in r for r in said)
    assert not any("was not applied" in remark for remark in run(LOCAL, mixed)[1].remarks)


def test_a_prediction_is_of_the_vehicle_and_not_of_its_balance(local: ForceResult, dataset: Dataset) -> None:
    law, condition = local.global_model, TRIALS[3].condition
    assert law is not None
    bare = predict(LOCAL, dataset, law, condition, points=100)
    spec = replace(LOCAL, effects=("balance_offset", "stroke_bias"), fixed={"balance_offset.z": 0.02})
    offset, bias = (replace(law.genes[0], name=n, constant=0.02, per_hz=0.0, per_rad=0.0) for n in OFFSET_AND_BIAS)
    found = predict(spec, dataset, replace(law, genes=(*law.genes, offset)), condition, points=100)
    assert found.values == bare.values
    assert np.array_equal(found.forces["x"], bare.forces["x"])
    assert np.array_equal(found.forces["z"], bare.forces["z"])
    biased = predict(spec, dataset, replace(law, genes=(*law.genes, bias)), condition, points=100)
    assert np.abs(biased.forces["x"] - bare.forces["x"]).max() > 1e-4
    assert biased.values["stroke_bias.angle"] == 0.02


def test_what_is_only_predicted_may_lack_the_fitted_axis(dataset: Dataset) -> None:
    seventh = dataset.recording("test-7")
    z_only = replace(seventh, forces=("z",), values=seventh.values[:, 1:])
    mixed = replace(dataset, recordings=tuple(z_only if r is seventh else r for r in dataset.recordings))
    found = run(LOCAL, mixed)[1]
    assert {a.quantity for a in found.agreements if a.recording == "test-7"} == {"z"}
    assert found.held_out_after is not None
    with pytest.raises(ValueError, match="force axis 'x' is to be fitted"):
        prepare(replace(LOCAL, recordings=()), replace(mixed, held_out=()))
