"""The virtual rig: its strobe, its tracking noise, its gaps, its plan, and what it writes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from wingfit.records import Dataset, Genome, Recording, load_dataset, wing_or_vehicle
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.virtual_rigs import campaign as campaign_module
from wingfit.sim.virtual_rigs.campaign import (
    FRAMES_PER_BEAT,
    VACUUM,
    WIND_TUNNEL,
    Tracking,
    blank_recording,
    campaign,
    name_of,
    record,
    robird_wing,
    true_genome,
    tunnel,
    vacuum,
    write_campaign,
)
from wingfit.sim.wing.flexible_wing import FlexibleWing

Array = npt.NDArray[np.float64]

QUICK = Numerics(steps=120, periodic=1e-4)
FREQUENCY = 3.0
CLEAN = Tracking(noise=(0.0, 0.0, 0.0), gap_rate=0.0, beats=2)


@pytest.fixture(scope="module")
def model() -> FlexibleWing:
    return FlexibleWing(robird_wing(), "4", numerics=QUICK)


def filmed(model: FlexibleWing, tracking: Tracking, seed: int = 1) -> Recording:
    genome = Genome.nominal(model.genes)
    return record(model, genome, tunnel(0.05, FREQUENCY, 6.0), tracking, np.random.default_rng(seed))


def test_strobe_runs_a_little_faster_than_the_wing(model: FlexibleWing) -> None:
    """31 frames over 30 beats: from frame to frame the wing is seen 1/31 of a beat earlier, one beat on."""
    recording = filmed(model, CLEAN)
    assert len(recording.times) == 31 * CLEAN.beats
    phase = recording.times * FREQUENCY
    np.testing.assert_allclose(1 / np.diff(recording.times), FREQUENCY * 31 / 30, rtol=1e-5)
    np.testing.assert_allclose(np.diff(phase) - 1, -1 / 31, atol=1e-6)
    assert FRAMES_PER_BEAT == 30


def test_frames_show_the_wing_at_their_times(model: FlexibleWing) -> None:
    """Noise-free: every frame lies on the periodic motion, one unknown trigger for all."""
    recording = filmed(model, CLEAN)
    condition = recording.condition
    beat = model.beat(Genome.nominal(model.genes).values, blank_recording(model.wing, condition)).tracks
    names = [m.name for m in model.wing.markers]
    motion = beat[:, [names.index(n) for n in recording.markers]]
    series = np.fft.rfft(motion, axis=0) / len(motion)
    series[1:] *= 2
    k = np.arange(len(series))

    def misfit(trigger: float, every: int) -> float:
        turn = np.exp(2j * np.pi * k * (FREQUENCY * recording.times[::every, None] + trigger))
        shown = np.tensordot(turn, series, 1).real
        return float(np.abs(shown - recording.positions[::every]).max())

    triggers = np.linspace(0, 1, 401)
    best = float(triggers[int(np.argmin([misfit(t, 8) for t in triggers]))])
    # tracks are rounded to 10 micrometres, and the trigger found here is good to 2e-5 of a beat: 25 micrometres
    assert min(misfit(t, 1) for t in np.linspace(best - 2.5e-3, best + 2.5e-3, 126)) < 5e-5


def test_noise_is_as_large_and_as_coloured_as_tracking_says() -> None:
    """Markers differ by a factor exp(0.2 g), g normal, whose mean square is exp(0.08)."""
    long = Tracking(noise=(4e-4, 2e-4, 8e-4), memory=0.6, gap_rate=0.0, beats=20)
    shape = (31 * long.beats, 49, 3)
    noise = campaign_module._noise(shape, long, np.random.default_rng(7))
    deviation = noise.std(axis=0)
    np.testing.assert_allclose(np.sqrt((deviation**2).mean(axis=0)), np.array(long.noise) * np.exp(0.04), rtol=0.08)
    assert np.log(deviation).std(axis=0).mean() == pytest.approx(0.2, abs=0.06)
    relative = deviation / np.array(long.noise)
    assert np.ptp(np.log(relative), axis=1).max() < 0.35, "a bad marker is bad along all axes"
    lagged = [(noise[k:] * noise[: len(noise) - k]).mean() / (noise**2).mean() for k in (1, 2)]
    np.testing.assert_allclose(lagged, [0.6, 0.36], atol=0.03)
    assert np.abs(noise.mean(axis=0)).max() < 3e-4
    frames = np.abs(np.corrcoef(noise[:, :, 0].T) - np.eye(49))
    assert frames.mean() < 0.1, "markers err on their own"


def test_noise_and_gaps_reach_the_recording(model: FlexibleWing) -> None:
    noisy, none = Tracking(), Tracking(memory=0.6, noise=(0.0, 0.0, 0.0))
    seen, bare = filmed(model, noisy), filmed(model, none)
    assert seen.markers == bare.markers
    scatter = np.nanstd(seen.positions - bare.positions, axis=(0, 1))
    np.testing.assert_allclose(scatter, np.array(noisy.noise) * np.exp(0.04), rtol=0.15)
    lost = np.isnan(seen.positions)
    assert np.array_equal(lost.any(axis=2), lost.all(axis=2)), "a marker is lost as a whole"
    assert lost.mean() == pytest.approx(noisy.gap_rate * noisy.gap_frames, rel=0.5)


def test_gaps_are_bursts_at_the_stated_rate() -> None:
    """Onsets at the rate, geometric lengths: hidden share 1 - exp(-rate * mean length), mean run near the length."""
    tracking = Tracking(gap_rate=0.006, gap_frames=5.0)
    lost = campaign_module._gaps((2000, 49), tracking, np.random.default_rng(2))
    assert lost.mean() == pytest.approx(0.03, rel=0.15)
    onsets = (lost[1:] & ~lost[:-1]).sum()
    assert lost.sum() / onsets == pytest.approx(5.0, rel=0.15)


def test_forty_of_forty_nine_markers_are_recorded(model: FlexibleWing) -> None:
    names = [m.name for m in model.wing.markers]
    assert len(set(names)) == 49
    first, second = filmed(model, CLEAN, 1), filmed(model, CLEAN, 2)
    for recording in (first, second):
        assert len(set(recording.markers)) == 40
        assert list(recording.markers) == [n for n in names if n in recording.markers]
        assert recording.values.shape == (62, 120)
    assert set(first.markers) != set(second.markers), "which are lost changes from run to run"


def test_markers_are_denser_to_tip_and_trailing_edge() -> None:
    wing = robird_wing()
    place = np.array([m.position for m in wing.markers])
    table = np.array([(s.y, s.leading_edge, s.chord, s.thickness) for s in wing.stations])
    le, chord, thickness = (np.interp(place[:, 1], table[:, 0], table[:, k]) for k in (1, 2, 3))
    rows = np.unique(place[:, 1])
    assert len(rows) == 7
    assert np.all(np.diff(rows, 2) < 0)
    fractions = ((place[:, 0] - le) / chord).reshape(7, 7)
    assert np.all(np.diff(fractions, axis=1) > 0)
    assert np.all(np.diff(fractions, 2, axis=1) < 0)
    assert fractions.min() > 0
    assert fractions.max() < 1
    np.testing.assert_allclose(place[:, 2], thickness / 2, atol=1e-5)


def test_the_plan_is_the_thesiss() -> None:
    assert (len(VACUUM), len(WIND_TUNNEL)) == (27, 45)
    plan = (*VACUUM, *WIND_TUNNEL)
    assert len({name_of(c) for c in plan}) == 72
    assert name_of(vacuum(10.0, np.radians(3.0), 3.0)) == "vac-0010mbar-lag3-3.0hz"
    assert name_of(tunnel(np.radians(7.0), 2.0, 8.5)) == "wt-08.5ms-lag7-2.0hz"
    assert {round(c.pressure) for c in VACUUM} == {1000, 10000, 100000}
    assert {c.airspeed for c in VACUUM} == {0.0}
    assert {c.airspeed for c in WIND_TUNNEL} == {1.0, 3.5, 6.0, 8.5, 11.0}
    for group in (VACUUM, WIND_TUNNEL):
        assert {c.flap_frequency for c in group} == {2.0, 3.0, 4.0}
        assert {round(np.degrees(c.phase_lag)) for c in group} == {0, 3, 7}


@pytest.mark.parametrize("small", [True, False])
def test_held_out_conditions_are_none_of_the_fitted(small: bool) -> None:
    plan = campaign_module.SMALL if small else campaign_module.FULL
    fitted, held = ({name_of(c) for c, out in plan if out is which} for which in (False, True))
    assert len(fitted) + len(held) == (10 if small else 72)
    assert not fitted & held
    assert {n[:2] for n in held} == {n[:2] for n in fitted} == {"va", "wt"}
    assert len(held) >= len(plan) // 5


def test_truth_lies_well_inside_the_box_and_follows_its_seed(model: FlexibleWing) -> None:
    ratios = np.array(
        [[true_genome(model, seed).as_dict()[g.name] / g.nominal for g in model.genes] for seed in range(40)]
    )
    assert ratios.min() > 0.55
    assert ratios.max() < 1.8
    assert ratios.min() < 0.58
    assert ratios.max() > 1.7
    np.testing.assert_allclose(np.log(ratios).mean(), 0.0, atol=0.05)
    assert true_genome(model, 3) == true_genome(model, 3) != true_genome(model, 4)


@pytest.fixture
def two_conditions(monkeypatch: pytest.MonkeyPatch) -> None:
    """A campaign short enough for a test."""
    pair = ((tunnel(0.05, 3.0, 6.0), False), (tunnel(0.05, 4.0, 6.0), True))
    monkeypatch.setattr(campaign_module, "SMALL", pair)
    monkeypatch.setattr(campaign_module, "REFERENCE", QUICK)


def values(dataset: Dataset) -> list[bytes]:
    return [r.values.tobytes() for r in dataset.recordings]


@pytest.mark.usefixtures("two_conditions")
def test_same_seed_same_campaign() -> None:
    progress: list[float] = []
    (first, truth), (again, same), (other, different) = (
        campaign(division="4", small=True, seed=seed, progress=progress.append) for seed in (5, 5, 6)
    )
    assert progress[:2] == [0.5, 1.0]
    assert values(first) == values(again)
    assert truth == same
    assert values(first) != values(other)
    assert truth != different
    one, two = first.recordings
    assert one.markers != two.markers, "every recording has noise and losses of its own"


@pytest.mark.usefixtures("two_conditions")
def test_written_campaign_reads_back_and_keeps_its_secret(tmp_path: Path) -> None:
    dataset, truth = campaign(division="4", small=True, seed=5)
    beside = write_campaign(tmp_path / "flight", division="4", small=True, seed=5)
    read = wing_or_vehicle(load_dataset(tmp_path / "flight"))
    assert read.held_out == dataset.held_out == (dataset.recordings[1].name,)
    for found, made in zip(read.recordings, dataset.recordings, strict=True):
        assert (found.name, found.markers, found.rig) == (made.name, made.markers, made.rig)
        np.testing.assert_allclose(found.values, made.values, atol=1e-9)
        np.testing.assert_allclose(found.times, made.times, atol=1e-9)
    assert beside == tmp_path / "flight.truth.json"
    stored = json.loads(beside.read_text(encoding="utf-8"))
    assert stored["genome"] == truth.as_dict()
    assert (stored["division"], stored["seed"]) == ("4", 5)
    inside = [p for p in (tmp_path / "flight").rglob("*") if p.is_file()]
    assert inside
    assert not any("truth" in p.name or repr(truth.as_dict()["E_f"]) in p.read_text(encoding="utf-8") for p in inside)
    assert not read.wing.estimates, "the truth must not come back as the user's estimates"
