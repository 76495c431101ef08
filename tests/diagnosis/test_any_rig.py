"""A rig of the user's own, from files to a finding: named, adequate, unnamed without the right suspect, and refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy

from wingfit import DiagnosisSpec, Finding, Series, SeriesDataset, diagnose, html, load_dataset
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.rig_check import check_rig
from wingfit.diagnosis.verdict.weigh_hypotheses import nominal_refuted
from wingfit.inference.noise.series_fit import SeriesReduction
from wingfit.records import Channel
from wingfit.records.array_types import Array
from wingfit.rigs.load import load_rig
from wingfit.rigs.rig import Rig

FOLDER = Path(__file__).parents[2] / "examples" / "pendulum"
TIMES: Array = 0.05 * np.arange(100, dtype=np.float64)
KEPT = ("swing-1", "swing-3", "swing-4", "swing-5")
SUSPECTS = ("dry_friction.pivot", "square_drag.pivot", "delay.angle")


@pytest.fixture(scope="module")
def rig() -> Rig:
    return load_rig(str(FOLDER / "rig.py"))


@pytest.fixture(scope="module")
def recorded() -> SeriesDataset:
    """Half of the example's samples, in three recordings."""
    found = load_dataset(FOLDER)
    assert isinstance(found, SeriesDataset)
    return replace(
        found,
        recordings=tuple(replace(one, times=one.times[::2], values=one.values[::2]) for one in found.select(KEPT)),
        held_out=KEPT[-1:],
    )


@pytest.fixture(scope="module")
def finding(rig: Rig, recorded: SeriesDataset) -> Finding:
    return diagnose(recorded, DiagnosisSpec(suspects=SUSPECTS), rig=rig)


def swings(seed: int, *, noise: float = 0.004, lag1: float = 0.0, deviation: float | None = None) -> SeriesDataset:
    """Free swings without friction, by another integrator than the rig's."""
    rng = np.random.default_rng(seed)
    channel, found = Channel("angle", "rad", deviation), []
    for k, start in enumerate((0.9, 0.5, 1.1)):

        def rate(_: float, state: Array) -> tuple[float, float]:
            return state[1], -0.12 * state[1] - 38.0 * np.sin(state[0])

        solved = scipy.integrate.solve_ivp(
            rate, (0.0, TIMES[-1]), (start, 0.0), "DOP853", TIMES, rtol=1e-10, atol=1e-12
        )
        error = rng.standard_normal(len(TIMES))
        for t in range(1, len(error)):
            error[t] = lag1 * error[t - 1] + np.sqrt(1 - lag1**2) * error[t]
        values = (solved.y[0] + noise * error)[:, None]
        found.append(Series(f"swing-{k}", TIMES, (channel,), values, estimates={"angle0": start}))
    return SeriesDataset("swings", "pendulum", tuple(found), (channel,), held_out=("swing-2",))


def test_the_hidden_friction_is_named_with_its_size(finding: Finding) -> None:
    assert finding.verdict == "named"
    assert finding.named == ("dry_friction.pivot",)
    size = next(gene.value for gene in finding.genes if gene.name == "dry_friction.pivot.size")
    assert size.low is not None
    assert size.high is not None
    assert size.low < 0.3 < size.high
    assert size.high - size.low < 0.03


def test_recordings_it_has_not_seen_are_predicted_to_the_noise(finding: Finding) -> None:
    assert finding.proof is not None
    assert finding.proof.improved
    assert finding.proof.before.value > 1.5
    assert finding.proof.after.value < 1.1


def test_misfits_are_in_noise_and_channels_in_their_units(finding: Finding) -> None:
    assert (finding.kind, finding.unit) == ("series", "noise")
    (channel,) = finding.channels
    assert channel.unit == "rad"
    assert channel.noise == pytest.approx(0.004, rel=0.1)
    assert channel.after < 0.3 * channel.noise < channel.before
    assert finding.floors.noise == pytest.approx(1.0, rel=0.05)
    assert "mN" not in finding.summary
    assert {one.unit for one in finding.overlays} == {"rad"}
    assert "in channel angle" in (finding.where.words if finding.where else "")


def test_the_report_shows_it_over_time(finding: Finding) -> None:
    page = html(finding)
    for words in ("dry friction at pivot", "time, s", "× noise", "Location of the misfit", "0.223°"[:3]):
        assert words in page
    for words in ("phase of the beat", " mN", "on the wing"):
        assert words not in page


def test_without_the_right_suspect_nothing_is_named(rig: Rig, recorded: SeriesDataset) -> None:
    found = diagnose(recorded, DiagnosisSpec(suspects=("delay.angle",), refits=1), rig=rig)
    assert found.verdict == "unnamed"
    assert found.strength > 3.0


@pytest.mark.parametrize(
    ("seed", "lag1", "deviation"), [(1, 0.0, None), (2, 0.0, 0.004), (3, 0.6, 0.004), (4, 0.6, None)]
)
def test_a_right_model_is_adequate_under_noise_of_any_colour(
    rig: Rig, seed: int, lag1: float, deviation: float | None
) -> None:
    found = diagnose(swings(seed, lag1=lag1, deviation=deviation), DiagnosisSpec(suspects=SUSPECTS), rig=rig)
    assert found.verdict == "adequate"


def test_a_noise_that_is_stated_too_large_is_remarked(rig: Rig) -> None:
    found = diagnose(swings(5, deviation=0.02), DiagnosisSpec(suspects=SUSPECTS), rig=rig)
    assert any("times the assumed noise" in one for one in found.remarks)
    assert any("highest frequencies of angle" in one for one in found.remarks)
    assert found.probabilities["adequate"] < 0.9


def test_a_noise_that_cannot_be_known_is_refused_with_a_remedy(rig: Rig) -> None:
    coarse = swings(6, noise=0.0)
    with pytest.raises(
        ValueError, match=r"noise of channel 'angle' is not known.*state its standard_deviation.*repeats"
    ):
        diagnose(coarse, rig=rig)


def test_the_contract_holds(rig: Rig, recorded: SeriesDataset) -> None:
    assert {one.outcome for one in check_rig(rig, recorded)} == {"pass"}


@pytest.mark.parametrize(
    ("channel", "message"),
    [
        (Channel("angle", "deg"), "'angle' is in 'deg' in dataset 'pendulum', but in 'rad'"),
        (Channel("speed", "rad/s"), "has a channel 'speed', which rig 'pendulum' does not simulate"),
    ],
)
def test_what_does_not_fit_together_is_named(rig: Rig, recorded: SeriesDataset, channel: Channel, message: str) -> None:
    recordings = tuple(replace(one, quantities=(channel,)) for one in recorded.recordings)
    with pytest.raises(ValueError, match=message):
        diagnose(replace(recorded, channels=(channel,), recordings=recordings), rig=rig)


def test_an_estimate_of_an_unknown_gene_is_named(rig: Rig, recorded: SeriesDataset) -> None:
    first = replace(recorded.recordings[0], estimates={"angel0": 0.9})
    with pytest.raises(ValueError, match=r"has an estimate of 'angel0', but .* are: angle0, speed0"):
        diagnose(replace(recorded, recordings=(first, *recorded.recordings[1:])), rig=rig)


def test_a_rig_is_needed_for_series(recorded: SeriesDataset) -> None:
    with pytest.raises(ValueError, match="series of rig 'pendulum'; give its simulation as rig"):
        diagnose(recorded)


@pytest.mark.parametrize("count", [100, 1600, 2500])
def test_an_accepted_error_does_not_depend_on_the_sampling(count: int) -> None:
    """A residual of 2 mm counts as none where 3 mm are accepted, and as misfit where 1 mm is."""
    times: Array = np.linspace(0.0, 5.0, count)
    residual = np.sqrt(2.0) * 2e-3 * np.sin(6.0 * times)
    for accepted, small in ((3e-3, True), (1e-3, False)):
        channel = Channel("angle", "rad", 1e-4, accepted_error=accepted)
        recording = Series("one", times, (channel,), np.cos(5.0 * times)[:, None])
        data = WhitenedData.of([recording], series=SeriesReduction.of([recording]))
        excess = data.excess(data.coefficients_of([residual[:, None]]))
        assert nominal_refuted(data, excess, 0.0) is not small
        assert data.accepted_of_samples == pytest.approx(accepted / 1e-4)  # the noise is 1e-4 rad


def test_repeats_are_one_sample_of_a_models_error() -> None:
    alone = [replace(one, quantities=(Channel("angle", "rad", 0.004),)) for one in swings(9).recordings]
    together = [replace(alone[0], name=f"r{k}", repeats="a") for k in range(4)]
    samples = [WhitenedData.of(one, series=SeriesReduction.of(alone)).effective_samples for one in (alone[:1], alone)]
    noises = {one.name: SeriesReduction.of(alone).noises[alone[0].name] for one in together}
    repeated = WhitenedData.of(together, series=SeriesReduction(noises, SeriesReduction.of(alone).scale))
    assert repeated.effective_samples == pytest.approx(samples[0])
    assert samples[1] > 2.0 * samples[0]


def test_repeats_are_left_out_together_and_do_not_validate_each_other(rig: Rig) -> None:
    """A second recording of the same experiment tests no prediction."""
    first, second, third = swings(3, deviation=0.004).recordings
    again = replace(
        first, name="again", values=first.values + 0.004 * np.random.default_rng(9).standard_normal((100, 1))
    )
    pair = replace(first, repeats="one"), replace(again, repeats="one")
    series = SeriesReduction.of((*pair, second))
    assert WhitenedData.of((*pair, second), series=series).experiments == ((0, 1), (2,))
    held_out = SeriesDataset("swings", "pendulum", (*pair, second, third), first.quantities, held_out=("again",))
    found = diagnose(held_out, DiagnosisSpec(suspects=SUSPECTS[:1]), rig=rig)
    assert any(one.startswith("held out, but repeats of fitted experiments: again") for one in found.remarks)
    alone = SeriesDataset("swings", "pendulum", pair, first.quantities)
    by_name = {one.effects: one for one in diagnose(alone, DiagnosisSpec(suspects=SUSPECTS[:1]), rig=rig).hypotheses}
    assert by_name[()].predicted in (None, 0.0)
