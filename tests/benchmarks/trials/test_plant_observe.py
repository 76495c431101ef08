from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.concealed.plant.law import Concealed
from benchmarks.concealed.plant.measurement import balance
from benchmarks.concealed.plant.measurement.balance import Weighed, Weighing, draw_weighing, silent, weigh
from benchmarks.concealed.plant.measurement.cameras import direction_values, divided, draw_cameras, places
from benchmarks.concealed.plant.measurement.film import FAULTS, Filmed, Filming, draw_filming, film, tracked, with_noise
from benchmarks.concealed.plant.measurement.noise import COLOURS, Noise, bursts, coloured, draw_noise, track_noise
from wingfit.records import Condition, Dataset, load_dataset, save_dataset
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.virtual_rigs.balance import delfly
from wingfit.sim.virtual_rigs.campaign import robird_wing, tunnel, vacuum

Array = npt.NDArray[np.float64]

WING, VACUUM = robird_wing(), vacuum(10.0, 0.0, 3.0)
REST = np.array([marker.position for marker in WING.markers])
PSI = 2 * np.pi * np.arange(192) / 192
FLAP = 0.5 * np.sin(PSI) + 0.05 * np.cos(2 * PSI)
BEAT = np.stack([Rotation.from_euler("x", angle).apply(REST) for angle in FLAP])  # a stiff wing, hinged at the origin
QUIET = Filming(Noise("first_order", 0.0), lost=0, gap_rate=0.0)
NOISY = with_noise(QUIET, 5e-4)


def rng(seed: int = 5) -> np.random.Generator:
    return np.random.default_rng(seed)


def rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def filmed(hidden: Concealed | None = None, filming: Filming = QUIET) -> Filmed:
    return film(BEAT, WING, VACUUM, filming, rng(), hidden)


def tracks(hidden: Concealed | None = None) -> Array:
    return filmed(hidden).clean.reshape(-1, len(REST), 3)


# -- noise ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("colour", COLOURS)
def test_noise_has_the_given_level(colour: str) -> None:
    noise = Noise(colour, 5e-4, 0.6)  # type: ignore[arg-type]
    made = track_noise(noise, 900, 40, rng())
    assert rms(made) == pytest.approx(5e-4, rel=0.05)
    assert rms(made[..., 2]) == pytest.approx(1.5 * rms(made[..., 0]), rel=0.1)
    assert np.array_equal(made, track_noise(noise, 900, 40, rng()))


def lagged(values: Array, lag: int) -> float:
    return float(np.mean(values[lag:] * values[:-lag]) / np.mean(values**2))


def test_noise_has_the_named_colour() -> None:
    shape = (4000, 30)
    first, wavy, pink, heavy = (coloured(c, 0.6, shape, rng()) for c in ("first_order", "wavy", "pink", "heavy"))
    assert [lagged(first, k) for k in (1, 2, 3)] == pytest.approx([0.6, 0.36, 0.216], abs=0.02)
    wanted = [lagged(wavy, k) for k in (1, 2, 3, 4)]
    for k in (2, 3):  # Yule and Walker, beyond the zero
        assert wanted[k] == pytest.approx(1.2 * math.cos(0.7) * wanted[k - 1] - 0.36 * wanted[k - 2], abs=0.02)
    power = (np.abs(np.fft.rfft(pink * np.hanning(4000)[:, None], axis=0)) ** 2).mean(axis=1)
    slope = np.polyfit(np.log(np.arange(10, 1000)), np.log(power[10:1000]), 1)[0]
    assert slope == pytest.approx(-1.0, abs=0.1)
    assert np.mean(heavy**4) / np.mean(heavy**2) ** 2 > 3.5
    assert lagged(heavy, 1) == pytest.approx(0.6, abs=0.03)
    assert np.mean(first**4) / np.mean(first**2) ** 2 == pytest.approx(3.0, abs=0.15)


def test_shake_is_common_to_all_markers() -> None:
    made = track_noise(Noise("shake", 1.0, 0.5, 0.4), 3000, 20, rng())[..., 0]
    alike = np.asarray(np.corrcoef(made.T))[np.triu_indices(20, 1)]
    assert alike.mean() == pytest.approx(0.4, abs=0.06)


def test_random_noise_has_every_colour_and_stays_within_bounds() -> None:
    drawn = [draw_noise(rng(seed)) for seed in range(60)]
    assert {noise.colour for noise in drawn} == set(COLOURS)
    assert all(2e-4 <= noise.level <= 8e-4 for noise in drawn)


def test_gaps_come_in_bursts() -> None:
    hole = bursts((20000, 5), 0.01, 6.0, rng())
    begun = (hole[1:] & ~hole[:-1]).sum()
    assert hole.mean() == pytest.approx(0.01 * 6.0, rel=0.15)
    assert hole.sum() / begun == pytest.approx(6.2, rel=0.1)


# -- filming --------------------------------------------------------------------------------------------------------


def test_a_strobe_goes_backwards_through_the_beat_and_a_fast_camera_forwards() -> None:
    for mode, apparent in (("strobe", -1 / 31), ("fast", 1 / 30.5)):
        shot = film(BEAT, WING, VACUUM, replace(QUIET, mode=mode), rng())  # type: ignore[arg-type]
        beats = shot.recording.times * 3.0
        steps = (np.diff(beats) + 0.5) % 1.0 - 0.5
        assert steps == pytest.approx(apparent, abs=6e-4)
        tip = shot.clean.reshape(-1, len(REST), 3)[:, int(REST[:, 1].argmax())]
        angle = np.arctan2(tip[:, 2], tip[:, 1])
        wave = np.exp(-2j * np.pi * beats)
        trigger = np.angle(2j * np.mean(angle * wave))
        again = 0.5 * np.sin(2 * np.pi * beats + trigger) + 0.05 * np.cos(2 * (2 * np.pi * beats + trigger))
        still = math.atan2(REST[int(REST[:, 1].argmax()), 2], REST[:, 1].max())
        assert rms(angle - again - still) < 0.02


def test_some_reference_markers_are_never_lost(tmp_path: Path) -> None:
    shots = []
    for seed in range(6):
        filming = replace(draw_filming(rng(seed)), lost=40)
        shots.append(film(BEAT, WING, tunnel(0.0, 3.0, 6.0), filming, rng(seed), name=f"f{seed}"))
        assert len(shots[-1].recording.markers) == 9
        assert len(set(shots[-1].recording.markers) & set(WING.reference_markers)) >= 4
        assert shots[-1].noise == pytest.approx(filming.noise.level, rel=0.4)
    save_dataset(Dataset("films", WING, tuple(shot.recording for shot in shots)), tmp_path / "films")
    back = load_dataset(tmp_path / "films").recordings
    np.testing.assert_allclose(back[0].values, shots[0].recording.values, atol=1e-9)


def test_gaps_affect_all_coordinates() -> None:
    shot = filmed(None, replace(NOISY, gap_rate=0.02, gap_frames=4.0))
    gone = np.isnan(shot.recording.positions)
    assert gone.mean() == pytest.approx(0.08, abs=0.03)
    assert (gone.any(axis=2) == gone.all(axis=2)).all()
    np.testing.assert_array_equal(np.isnan(shot.clean), np.isnan(shot.recording.values))


def test_random_numbers_do_not_depend_on_hidden_faults() -> None:
    plain, shifted = (
        filmed(hidden, NOISY) for hidden in (None, {"camera_shift": {"strength": 0.01, "azimuth": 0.0, "height": 0.0}})
    )
    moved = (shifted.recording.positions - plain.recording.positions)[..., 0]
    np.testing.assert_allclose(moved, 0.01, atol=6e-5)
    assert np.array_equal(filmed(None, NOISY).recording.values, plain.recording.values)
    assert plain.noise == pytest.approx(5e-4, rel=0.1)
    np.testing.assert_allclose(plain.clean, filmed().clean, atol=1e-12)


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_of_zero_strength_changes_nothing_and_a_stronger_one_changes_more(name: str) -> None:
    drawn, filming = FAULTS[name].draw(rng(3)), replace(QUIET, beats=2)
    if name == "marker_swap":
        drawn["strength"] = 1.0

    def hide(part: float) -> Array:
        shot = film(BEAT, WING, VACUUM, filming, rng(), {name: drawn | {"strength": part * drawn["strength"]}})
        return shot.clean

    nominal = film(BEAT, WING, VACUUM, filming, rng()).clean
    np.testing.assert_array_equal(hide(0.0), nominal)
    small, large = rms(hide(0.5) - nominal), rms(hide(1.0) - nominal)
    assert large > 2e-5
    assert 1.2 < large / small < 12.0


def test_listed_faults_are_in_the_library_and_the_others_are_not() -> None:
    for laws in (FAULTS, balance.FAULTS):
        for law in laws.values():
            assert (law.name in EFFECTS) == law.listed
            for gene in law.values(law.draw(rng())):
                effect, parameter = gene.split(".")
                assert parameter in {p.name for p in EFFECTS[effect].parameters}


def test_rays_intersect_at_the_marker() -> None:
    cameras = draw_cameras(WING, rng())
    points = REST + 0.1 * rng().standard_normal(REST.shape)
    found = cameras.points((cameras.image(points, 0), cameras.image(points, 1)))
    np.testing.assert_allclose(found, points, atol=1e-12)


def test_wrong_camera_poses_rotate_shift_and_scale_the_frame() -> None:
    angles = {"azimuth": 0.7, "height": 0.3}
    turn = {"strength": 0.01} | angles
    vector = np.array(list(direction_values("camera_rotation", turn).values()))
    turned = Rotation.from_rotvec(vector).apply(tracks().reshape(-1, 3)).reshape(tracks().shape)
    assert rms(tracks({"camera_rotation": turn}) - turned) < 0.06 * rms(turned - tracks())
    shift = {"strength": 0.005} | angles
    moved = np.array(list(direction_values("camera_shift", shift).values()))
    np.testing.assert_allclose(
        tracks({"camera_shift": shift}) - tracks(), np.broadcast_to(moved, tracks().shape), atol=2e-4
    )
    np.testing.assert_allclose(tracks({"scale_error": {"strength": 0.02}}), 1.02 * tracks(), atol=1e-9)


def test_distortion_follows_the_division_model_and_a_delay_affects_motion_only() -> None:
    image = 0.2 * rng().standard_normal((50, 2))
    distorted = divided(image, 0.3)
    back = distorted / (1.0 + 0.3 * (distorted**2).sum(axis=1, keepdims=True))
    np.testing.assert_allclose(back, image, atol=1e-12)
    still = np.repeat(BEAT[:1], 96, axis=0)
    for name in ("camera_desync", "rolling_shutter", "strobe_rate"):
        shot = film(still, WING, VACUUM, QUIET, rng(), {name: {"strength": 0.003}})
        np.testing.assert_allclose(shot.clean, film(still, WING, VACUUM, QUIET, rng()).clean, atol=1e-9)
        assert rms(tracks({name: {"strength": 0.003}}) - tracks()) > 1e-4


def test_rolling_shutter_images_the_tip_late() -> None:
    rolled, straight = tracks({"rolling_shutter": {"strength": 0.004}}), tracks()
    rate = 2 * np.pi * 3.0
    wave = np.exp(-1j * rate * filmed().recording.times)[:, None]
    behind = np.angle((rolled[..., 2] * wave).sum(axis=0) / (straight[..., 2] * wave).sum(axis=0)) / rate
    slope = np.polyfit(places(WING)[:, 0], behind, 1)[0]
    assert slope == pytest.approx(0.004, rel=0.1)


def test_a_marker_slips_along_the_skin_and_two_names_are_exchanged() -> None:
    slip = {"strength": 0.006, "span": 0.7, "chord": 0.5, "azimuth": 0.4}
    off = tracks({"marker_slip": slip}) - tracks()
    assert (np.abs(off).max(axis=(0, 2)) > 1e-9).sum() == 1
    one = int(np.abs(off).max(axis=(0, 2)).argmax())
    assert np.abs(places(WING)[one] - [0.7, 0.5]).max() < 0.15
    np.testing.assert_allclose(np.linalg.norm(off[:, one], axis=1), 0.006, rtol=1e-6)
    np.testing.assert_allclose(off[:, one, 0], 0.006 * math.cos(0.4), rtol=1e-6)  # turns about x with the wing
    for part in (0.4, 1.0):
        swapped = tracks({"marker_swap": {"strength": part, "span": 0.7, "chord": 0.5}})
        changed = (swapped != tracks()).any(axis=2)
        assert changed.any(axis=1).mean() == pytest.approx(part, abs=0.01)
        assert changed.any(axis=0).sum() == 2
        first, second = np.flatnonzero(changed.any(axis=0))
        rows = changed.any(axis=1)
        np.testing.assert_array_equal(swapped[rows, first], tracks()[rows, second])


def test_the_tracker_follows_constant_acceleration_and_smooths_other_motion() -> None:
    lag, t = {"tracker_lag": {"strength": 20.0}}, np.arange(60.0)[:, None, None]
    even = 1.0 + 0.1 * t + 0.02 * t**2 + np.zeros((60, 4, 3))
    hole = bursts((60, 4), 0.05, 4.0, rng())
    assert hole.any()
    np.testing.assert_allclose(tracked(even, hole, lag), even, atol=1e-6)
    white, seen = rng().standard_normal((400, 10, 3)), np.zeros((400, 10), bool)
    smoothed = [rms(tracked(white, seen, {"tracker_lag": {"strength": s}})) for s in (1e-3, 2.0, 20.0, 200.0)]
    assert smoothed[0] == pytest.approx(rms(white), rel=1e-3)
    assert (np.diff(smoothed) < 0.0).all()
    assert smoothed[-1] < 0.7
    assert rms(tracks(lag) - tracks()) > 1e-3


def test_pane_glare_and_creep_act_where_and_when_they_should() -> None:
    pane = np.abs(tracks({"pane_edge": {"strength": 0.003, "span": 0.6, "azimuth": 0.3}}) - tracks()).max(axis=(0, 2))
    assert pane[places(WING)[:, 0] < 0.45].max() < 0.02 * pane[places(WING)[:, 0] > 0.8].min()
    glare = {"strength": 0.006, "span": 0.7, "chord": 0.5, "phase": 0.25, "azimuth": 0.0}
    pulled = np.linalg.norm(tracks({"glare": glare}) - tracks(), axis=2)
    _, marker = np.unravel_index(pulled.argmax(), pulled.shape)
    assert pulled.max() == pytest.approx(0.006, rel=0.5)
    assert np.abs(places(WING)[marker] - [0.7, 0.5]).max() < 0.2
    assert (pulled.max(axis=1) > 0.05 * pulled.max()).mean() < 0.35
    crept = tracks({"thermal_creep": {"strength": 0.004, "time": 0.5, "azimuth": 0.0}}) - tracks()
    np.testing.assert_allclose(crept, crept[:, :1].repeat(len(REST), axis=1), atol=1e-9)
    assert (np.diff(crept[:, 0, 0]) > 0).all()


# -- the balance ----------------------------------------------------------------------------------------------------

VEHICLE, AIR = delfly(), Condition(12.5, 0.0, 101325.0, 293.15, 0.65, 1.2)
T = np.arange(480) / 480
FORCES = np.stack([0.15 + 0.2 * np.cos(2 * np.pi * T), 0.05 * np.sin(4 * np.pi * T)], axis=1)
STILL = replace(silent(draw_weighing(rng(1))), beats=12)


def weighed(hidden: Concealed | None = None, weighing: Weighing = STILL, forces: Array = FORCES) -> Weighed:
    return weigh(forces, VEHICLE, AIR, weighing, rng(), hidden)


def wave(values: Array, weighing: Weighing, k: int) -> npt.NDArray[np.complex128]:
    """Complex amplitude of harmonic k."""
    times = np.arange(len(values)) / weighing.rate
    return np.asarray(2.0 * (values * np.exp(-2j * np.pi * k * 12.5 * times)[:, None]).mean(axis=0))


def test_a_balance_without_noise_records_the_forces() -> None:
    shot = weighed()
    t = shot.recording.times * 12.5
    wanted = np.stack([0.15 + 0.2 * np.cos(2 * np.pi * t), 0.05 * np.sin(4 * np.pi * t)], axis=1)
    np.testing.assert_allclose(shot.clean, wanted, atol=2e-6)
    assert shot.noise < 1e-9
    assert shot.recording.forces == ("x", "z")


def test_variation_between_beats_and_noise_have_the_given_size(tmp_path: Path) -> None:
    weighing = replace(STILL, scatter=0.02, beats=60)
    shot = weighed(None, weighing, np.full((480, 2), 0.2))
    assert np.std(shot.recording.values / 0.2) == pytest.approx(0.02, rel=0.35)
    for colour in ("pink", "heavy"):
        noisy = weighed(None, replace(STILL, sensor=2e-3, colour=colour, memory=0.4))
        assert noisy.noise == pytest.approx(2e-3, rel=0.2)
    rattling = weighed(None, replace(STILL, rattle=6e-3, mount=(110.0, 90.0))).recording.values - weighed().clean
    spectrum = np.abs(np.fft.rfft(rattling, axis=0))
    at = np.fft.rfftfreq(len(rattling), 1 / STILL.rate)
    assert at[spectrum.argmax(axis=0)] == pytest.approx([110.0, 90.0], abs=8.0)
    shots = [weigh(FORCES, VEHICLE, AIR, draw_weighing(rng(k)), rng(k), name=f"b{k}").recording for k in range(3)]
    save_dataset(Dataset("balance", VEHICLE, tuple(shots)), tmp_path / "balance")
    assert len(load_dataset(tmp_path / "balance").recordings) == 3


@pytest.mark.parametrize("name", [name for name in balance.FAULTS if name not in balance.CHOICES])
def test_a_balance_fault_of_zero_strength_changes_nothing_and_a_stronger_one_changes_more(name: str) -> None:
    drawn = balance.FAULTS[name].draw(rng(3))

    def hide(part: float) -> Array:
        return weighed({name: drawn | {"strength": part * drawn["strength"]}}).clean

    np.testing.assert_array_equal(hide(0.0), weighed().clean)
    small, large = (rms(hide(part) - weighed().clean) for part in (0.5, 1.0))
    assert large > 5e-4
    assert 1.2 < large / small < 20.0


def test_mount_and_amplifier_have_their_transfer_functions() -> None:
    p = {"strength": 0.3, "frequency": 60.0, "damping": 0.2}
    ratio = 12.5 / 60.0
    felt = (1 + 0.4j * ratio) / (1 - ratio**2 + 0.4j * ratio)
    found = wave(weighed({"balance_resonance": p}).clean, STILL, 1)[0] / wave(weighed().clean, STILL, 1)[0]
    assert abs(found - (1 + 0.3 * (felt - 1))) < 4e-3  # half of 0.2 ms late
    found = wave(weighed({"filter_delay": {"strength": 2e-3}}).clean, STILL, 1)[0] / wave(weighed().clean, STILL, 1)[0]
    assert abs(found - (1 + 2j * np.pi * 12.5 * 2e-3 / 4) ** -4) < 0.01
    found = wave(weighed({"clock_offset": {"strength": 1e-3}}).clean, STILL, 1)[0] / wave(weighed().clean, STILL, 1)[0]
    assert abs(found - np.exp(2j * np.pi * 12.5 * 1e-3)) < 1e-6


def test_tilt_gain_zero_error_and_drift() -> None:
    clean = weighed().clean
    tilted = weighed({"balance_tilt": {"strength": 0.04}}).clean
    np.testing.assert_allclose(tilted, clean @ [[1.0, 0.04], [-0.04, 1.0]], atol=1e-9)
    np.testing.assert_allclose(weighed({"scale_error": {"strength": 0.1}}).clean, clean * [1.1, 1.09], atol=1e-9)
    offset = weighed({"balance_offset": {"strength": 0.01, "azimuth": 0.5}}).clean - clean
    np.testing.assert_allclose(offset, np.broadcast_to([0.01 * math.cos(0.5), 0.01 * math.sin(0.5)], offset.shape))
    drift = weighed({"balance_drift": {"strength": 0.01, "azimuth": 0.0, "time": 0.2}}).clean - clean
    np.testing.assert_allclose(drift[:, 0], 0.01 * np.log1p(np.arange(len(drift)) / 1250.0 / 0.2), atol=1e-12)


def test_dry_friction_and_saturation() -> None:
    stuck = weighed({"dry_friction": {"strength": 0.02}}).clean
    assert np.abs(stuck - weighed().clean).max() == pytest.approx(0.02, rel=0.05)
    assert stuck[200:, 0].max() == pytest.approx(0.35 - 0.02, abs=2e-3)
    weight = VEHICLE.mass * 9.80665
    clipped = weighed({"clipping": {"strength": 20.0}}).clean
    assert np.abs(clipped).max() <= weight / 20.0 + 1e-12
