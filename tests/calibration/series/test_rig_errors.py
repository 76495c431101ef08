"""Standard errors of a calibrated rig are honest; what the data cannot show, or cannot be calibrated, is said."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import wingfit
from tests.calibration.series.swing import NOISE, RIG, STARTS, TRUTH, dataset, recorded, three
from tests.calibration.series.test_calibrate_rig import calibrated, genes, spec
from wingfit import CalibrationSpec, Channel, Gene
from wingfit.calibration.preparation import prepare_rig
from wingfit.records.array_types import Array
from wingfit.rigs.run import Run, SimulationError

SEEDS = 30
ALL = {**TRUTH, "start[a]": STARTS["a"], "start[b]": STARTS["b"], "speed[a]": 0.1, "speed[b]": 0.1}


@pytest.mark.parametrize("lag1", [0.0, 0.7])
def test_standard_errors_cover_the_truth(lag1: float) -> None:
    """About 68 % of the estimates lie within one standard error, under white and under coloured noise."""
    inside = []
    for seed in range(SEEDS):
        found = genes(calibrated(dataset(recorded("a", seed, lag1=lag1), recorded("b", seed, lag1=lag1))))
        inside.append(
            [abs(found[name].best - truth) < (found[name].absolute_error or 0.0) for name, truth in ALL.items()]
        )
    assert 0.55 < np.mean(inside) < 0.8
    assert (np.mean(inside, axis=0) > 0.4).all()


def test_noise_of_each_channel_has_its_own_colour() -> None:
    """Coloured noise of one channel widens the errors of the genes that this channel shows."""
    white, coloured = recorded("a"), recorded("a", lag1=0.9)
    mixed = replace(white, values=np.stack([coloured.values[:, 0], white.values[:, 1]], axis=1))
    errors = [genes(calibrated(dataset(one)))["start[a]"].absolute_error or 0.0 for one in (white, mixed, coloured)]
    assert errors[0] < errors[1] < 1.5 * errors[2]


def test_noise_that_is_not_known_is_none_and_said() -> None:
    at = np.linspace(0.0, 3.0, 12)  # too few samples to see noise
    plain = tuple(Channel(one.name, one.unit) for one in recorded("a").quantities)
    short = [recorded(name, times=at, quantities=plain) for name in "ab"]
    found = calibrated(dataset(*short))
    assert [one.noise for one in found.recordings[0].channels] == [None, None]
    assert found.relative_to == "range"
    assert found.after is not None
    assert found.after < 0.05
    assert any("the noise of channels position, speed is not known" in one for one in found.remarks)
    stated = replace(plain[0], standard_deviation=NOISE[0])
    found = calibrated(dataset(*(replace(one, quantities=(stated, plain[1])) for one in short)))
    assert [one.noise for one in found.recordings[0].channels] == [NOISE[0], None]
    assert any("the noise of channel speed is not known" in one for one in found.remarks)


def test_noise_of_repeats_and_of_the_highest_frequencies_is_known() -> None:
    plain = tuple(Channel(one.name, one.unit) for one in recorded("a").quantities)
    fast = calibrated(dataset(*(recorded(name, quantities=plain) for name in "ab")))
    twice = (recorded("a", seed, quantities=plain, repeats="a") for seed in (1, 2))
    again = [replace(one, name=f"a{k}") for k, one in enumerate(twice)]
    repeated = calibrated(dataset(*again))
    for found in (fast, repeated):
        for channel, noise in zip(found.recordings[0].channels, NOISE, strict=True):
            assert channel.noise == pytest.approx(noise, rel=0.3)


def test_an_accepted_error_counts_as_noise() -> None:
    coarse = three(added={"creep.rate": 0.02})
    accepted = (replace(coarse.channels[0], accepted_error=0.05), coarse.channels[1])
    recordings = tuple(replace(one, quantities=accepted) for one in coarse.recordings)
    coarse = replace(coarse, recordings=recordings, channels=accepted)
    found = calibrated(coarse)
    assert not any("beyond the noise: position" in one for one in found.remarks)


def test_genes_that_the_data_do_not_show_are_named() -> None:
    idle = replace(RIG, genes=(*RIG.genes, Gene("colour", "1", 1.0, 0.5, 2.0, "log", "of the mass")))
    found = calibrated(three(), rig=idle)
    assert not genes(found)["colour"].identifiable
    assert any("colour is not identifiable" in one for one in found.remarks)
    tight = replace(RIG, genes=(replace(RIG.genes[0], upper=50.0), RIG.genes[1]))
    found = calibrated(three(), rig=tight)
    assert any("stiffness is at its upper bound 50" in one for one in found.remarks)
    assert not genes(found)["stiffness"].identifiable


def test_a_recording_that_cannot_be_simulated_is_said() -> None:
    def gone(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        if run.recording == "c":
            raise SimulationError("its state was not recorded")
        return dict(RIG.simulate(genes, run))

    found = calibrated(three(), rig=replace(RIG, simulate=gone))
    assert found.recordings[2].after is None
    assert found.held_out_after is None
    assert any("recording 'c' cannot be simulated with the best genome: " in one for one in found.remarks)
    assert found.after == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"division": "4"}, "division '4' describes a wing or a vehicle"),
        ({"search_division": "4"}, "search_division '4' describes"),
        ({"bounds_factor": 2.0}, "bounds_factor 2.0 describes"),
        ({"accuracy": 1e-3}, "accuracy 0.001 describes"),
        ({"preset": "dickinson"}, "preset 'dickinson' describes"),
        ({"without": ("wake",)}, "without .* describes"),
        ({"axes": ("x", "z")}, "axes .* describes"),
        ({"low_pass": 40.0}, "low_pass 40.0 describes"),
        ({"peel_width": 0.1}, "peel_width 0.1 describes"),
        ({"mode": "staged"}, "mode 'staged' is for wings or vehicles"),
        ({"mode": "local"}, "mode 'local' is for wings or vehicles"),
        ({"mode": "every"}, "unknown mode 'every'"),
        ({"method": "newton"}, "unknown method 'newton'"),
        ({"method": "auto", "finish": True}, "finish means nothing"),
        ({"population": 2}, "population is 2; it should be greater than or equal to 4"),
        ({"genes": ("mass",)}, "unknown gene 'mass'; there are stiffness, damping, start"),
        ({"genes": ("damping", "damping")}, "gene 'damping' is named 2 times"),
        ({"genes": ("start[c]",)}, "gene 'start\\[c\\]' belongs to recording 'c', which is not fitted"),
        ({"fixed": {"damping": 9.0}}, "gene 'damping' is 9 1/s; it must lie in"),
        ({"fixed": dict.fromkeys(ALL, 0.1) | {"stiffness": 40.0}}, "nothing to calibrate"),
        ({"effects": ("rust",)}, "unknown suspect 'rust'; rig 'swing' has creep, "),
        ({"effects": ("creep", "creep")}, "effect 'creep' is named 2 times"),
        ({"effects": ("creep",), "genes": ("damping",)}, "effect 'creep' would stay switched off"),
        ({"recordings": ("c",)}, "recording 'c' is held out"),
        ({"recordings": ("d",)}, "no recording 'd'"),
    ],
)
def test_settings_that_do_not_fit_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        prepare_rig(replace(CalibrationSpec(), **changes), RIG, three())


def test_recordings_that_do_not_fit_are_refused() -> None:
    data = three()
    with pytest.raises(ValueError, match="give its simulation as rig"):
        wingfit.calibrate(data)
    with pytest.raises(ValueError, match="has a channel 'speed', which rig 'swing' does not simulate"):
        wingfit.calibrate(data, rig=replace(RIG, channels={"position": "m"}))
    with pytest.raises(ValueError, match="every recording of the dataset is held out"):
        wingfit.calibrate(replace(data, held_out=tuple(STARTS)), rig=RIG)
    blank = replace(data.recordings[1], values=np.full((80, 2), np.nan))
    with pytest.raises(ValueError, match="recording 'b' has no value of any channel"):
        prepare_rig(spec(), RIG, replace(data, recordings=(data.recordings[0], blank), held_out=()))
    differs = replace(recorded("b"), repeats="x", settings={"mass": 2.0})
    with pytest.raises(ValueError, match="different settings"):
        prepare_rig(spec(), RIG, dataset(replace(recorded("a"), repeats="x"), differs))


def test_a_nominal_model_that_cannot_be_simulated_is_refused_by_gauss_newton() -> None:
    stiff = replace(RIG, genes=(replace(RIG.genes[0], nominal=150.0), RIG.genes[1]))
    with pytest.raises(ValueError, match="the spring breaks"):
        calibrated(three(), rig=stiff)
    found = calibrated(three(), spec("auto"), rig=stiff)
    assert genes(found)["stiffness"].best == pytest.approx(TRUTH["stiffness"], rel=0.01)
    assert found.before is None


@pytest.mark.parametrize("samples", [1, 2, 4])
def test_a_short_recording_has_no_small_errors(samples: int) -> None:
    """Its own genes fit it exactly, so that its residuals say nothing about the noise."""
    times = np.linspace(0.0, 1.0, samples) if samples > 1 else np.zeros(1)
    found = []
    for seed in range(12):
        short = recorded("a", seed, times=times, estimates={})
        start = genes(calibrated(dataset(short, recorded("b", seed))))["start[a]"]
        assert start.absolute_error is not None
        found.append((start.best - STARTS["a"]) / start.absolute_error)
    assert np.sqrt(np.mean(np.square(found))) < 1.8


def test_no_more_samples_than_genes_give_no_error() -> None:
    one = recorded("a", times=np.linspace(0.0, 1.0, 2), estimates={})
    found = calibrated(dataset(one))
    assert not any(gene.identifiable for gene in found.genes)
    assert any("4 samples do not determine 4 genes" in remark for remark in found.remarks)
