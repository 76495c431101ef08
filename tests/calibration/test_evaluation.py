from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.calibration.wave_forces import PITCH, RATE, F, recording, waves
from wingfit.calibration.forces.agreement import (
    agreements,
    comparison,
    quantities,
    spectrum,
    whole_beats,
)
from wingfit.calibration.forces.split_beats import pieces
from wingfit.records import LowPass
from wingfit.sim.filtering import low_passed


def test_lift_and_drag_turn_with_the_pitch() -> None:
    forces = np.array([[1.0, 0.0], [0.0, 1.0]])
    named = quantities(recording(forces), forces)
    np.testing.assert_allclose(named["lift"], [np.sin(PITCH), -np.cos(PITCH)])
    np.testing.assert_allclose(named["drag"], [-np.cos(PITCH), -np.sin(PITCH)])
    assert set(quantities(recording(forces[:, :1]), forces[:, :1])) == {"x"}


def test_mean_beat_begins_at_the_start_of_a_beat_wherever_the_recording_does() -> None:
    late = waves(start=0.033)
    beats = whole_beats(late, points=50)
    np.testing.assert_allclose(beats.mean["x"], 0.2 + 0.1 * np.cos(2 * np.pi * beats.phase), atol=1e-5)
    assert beats.samples["x"].shape == (9, 50)


def test_scatter_between_beats_is_that_of_the_beats() -> None:
    steady = waves()
    scale = 1 + 0.1 * np.repeat([-1, 1] * 5, 80)[:, None]
    spread = whole_beats(replace(steady, values=steady.values * scale), points=80).spread["x"]
    inside = slice(5, 75)
    expected = 0.1 * np.sqrt(10 / 9) * (0.2 + 0.1 * np.cos(2 * np.pi * np.arange(80) / 80))
    np.testing.assert_allclose(spread[inside], expected[inside], rtol=1e-3)


def test_beats_with_gaps_are_left_out() -> None:
    broken = waves().values.copy()
    broken[100:110] = np.nan
    found = whole_beats(recording(broken))
    assert len(found.samples["x"]) == 9
    assert np.isfinite(found.mean["x"]).all()
    assert np.isfinite([a.rmse for a in agreements(recording(broken), waves().values, "local")]).all()


def test_ends_that_a_filter_spoils_do_not_count_and_those_uploaded_filtered_do() -> None:
    low = low_passed(waves(noise=0.05), LowPass(40.0))
    assert len(whole_beats(low).samples["x"]) == 8
    uploaded = replace(waves(), low_pass=LowPass(40.0))
    assert len(whole_beats(uploaded).samples["x"]) == 10
    assert len(whole_beats(low_passed(waves(beats=2), LowPass(40.0))).samples["x"]) == 2  # there are no others


def test_recording_without_a_whole_beat_is_refused() -> None:
    with pytest.raises(
        ValueError, match=r"no whole beat.*no beat of 0\.08 s begins and ends in its 0\.04 s.*at least one"
    ):
        whole_beats(recording(np.zeros((40, 2))))
    with pytest.raises(ValueError, match="no beat"):
        whole_beats(recording(np.zeros((110, 2)), start=0.04))  # 1.4 beats, from the middle of one
    broken = waves().values.copy()
    broken[::70, 1] = np.nan
    with pytest.raises(ValueError, match=r"each of its 10 whole beats lacks samples; fill the gaps"):
        whole_beats(recording(broken))


@pytest.mark.parametrize("level", [0.0, 0.05, -3e-7])
def test_a_constant_force_has_neither_percentage_nor_correlation(level: float) -> None:
    values = waves().values.copy()
    values[:, 1] = level
    for steady in (recording(values), low_passed(recording(values), LowPass(40.0))):
        found = {a.quantity: a for a in agreements(steady, waves().values, "local")}
        assert np.isnan([found["z"].rmse_percent, found["z"].correlation]).all()
        assert np.isfinite([found[name].rmse_percent for name in ("x", "lift", "drag")]).all()
        assert found["x"].correlation > 0.99
        assert found["z"].mean_recorded == pytest.approx(level, abs=1e-12)
    (_, _, _, z) = agreements(waves(), values, "local")
    assert np.isnan(z.correlation)
    assert z.rmse_percent > 10


def test_agreement_in_numbers() -> None:
    recorded = waves()
    model = recorded.values + np.array([0.02, 0.0])
    x = next(a for a in agreements(recorded, model, "local") if a.quantity == "x")
    assert x.rmse == pytest.approx(0.02)
    assert x.rmse_percent == pytest.approx(10.0, rel=1e-3)  # of the range, 0.2 N
    assert x.correlation == pytest.approx(1.0)
    assert (x.mean_recorded, x.mean_modelled) == pytest.approx((0.2, 0.22))
    against = agreements(recorded, -recorded.values, "local")
    assert [a.correlation for a in against if a.quantity in "xz"] == pytest.approx([-1.0, -1.0])
    assert {a.quantity for a in against} == {"x", "z", "lift", "drag"}


def test_means_are_over_whole_beats() -> None:
    cut = waves(beats=10).values[:777]  # 9.7 beats
    assert agreements(recording(cut), cut, "local")[2].mean_recorded == pytest.approx(0.2, abs=1e-6)


def test_spectrum_holds_the_variance() -> None:
    noisy = waves(beats=12, noise=0.02)
    frequency, density = spectrum(noisy, noisy.values)
    pieces = noisy.values[:, 0].reshape(3, -1)
    assert density["x"].sum() * frequency[1] == pytest.approx(pieces.var(axis=1).mean(), rel=1e-12)
    assert frequency[1] == pytest.approx(F / 4)
    assert frequency[-1] <= RATE / 2


def test_spectrum_of_a_harmonic_is_one_line() -> None:
    frequency, density = spectrum(waves(), waves().values)
    assert frequency[density["z"].argmax()] == pytest.approx(2 * F)
    assert density["z"].max() * frequency[1] == pytest.approx(0.03**2 / 2, rel=1e-9)
    assert np.sort(density["z"])[-2] < 1e-9 * density["z"].max()


@pytest.mark.parametrize("start", [0.0, 0.03, 0.04, 0.079])
def test_spectrum_does_not_depend_on_where_the_recording_starts(start: float) -> None:
    low = low_passed(waves(beats=8, start=start), LowPass(60.0))
    frequency, density = spectrum(low, low.values)
    assert frequency[density["x"].argmax()] == pytest.approx(F)
    assert density["x"].max() * frequency[1] == pytest.approx(0.1**2 / 2, rel=1e-3)


def test_spectrum_lies_between_the_gaps() -> None:
    broken = waves(beats=12).values.copy()
    broken[[330, 400]] = np.nan  # leaves 4.1, 0.9 and 7 beats
    frequency, density = spectrum(recording(broken), broken)
    assert frequency[1] == pytest.approx(F / 4)
    assert density["z"].max() * frequency[1] == pytest.approx(0.03**2 / 2, rel=1e-9)
    broken[::200] = np.nan  # now none of four beats
    frequency, density = spectrum(recording(broken), broken)
    assert frequency[1] == pytest.approx(F / 2)
    assert density["z"].max() * frequency[1] == pytest.approx(0.03**2 / 2, rel=1e-9)


def test_a_beat_need_not_be_a_whole_number_of_samples() -> None:
    t = np.arange(94) / 1174.8  # 93.98 a beat
    one = replace(recording(np.cos(2 * np.pi * F * t)[:, None]), times=t)
    assert len(spectrum(one, one.values)[0]) == 48
    short = replace(one, times=t[:93] + 0.08 - t[92] - 1e-5, values=one.values[:93])
    assert len(pieces(short, 4)[0]) == 93


def test_pieces_with_gaps_give_no_spectrum() -> None:
    holes = waves().values.copy()
    holes[::30] = np.nan
    frequency, density = spectrum(recording(holes), holes)
    assert len(frequency) == len(density) == 0


def test_comparison_lays_mean_beats_over_each_other() -> None:
    found = comparison(waves(), 2 * waves().values, "global")
    np.testing.assert_allclose(found.modelled["lift"], 2 * found.recorded["lift"])
    assert found.recorded_spectrum["x"].shape == found.frequency.shape
    assert found.remarks == ()
