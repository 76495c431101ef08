"""Free-flight forces: frames, gravity, spin, and standard deviations that hold."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy import signal
from scipy.spatial.transform import Rotation

from tests.oracles.wing_kinematics import noise
from wingfit.records import LowPass
from wingfit.records.description.vehicle_file import VehicleRecordingFile
from wingfit.tracking.free_flight import Body, FreeFlight, free_flight, recording
from wingfit.tracking.rigid_body import poses
from wingfit.tracking.zero_phase import kernels

Array = npt.NDArray[np.float64]
GRAVITY = 9.80665
MARKERS = np.array(
    [[0, 0, 0], [-0.08, 0, 0], [-0.14, 0.06, 0], [-0.14, -0.06, 0], [-0.15, 0, -0.05], [-0.03, 0.01, 0.02]]
)
CENTRE = np.array([-0.05, 0, 0.005])
BODY = Body(MARKERS, CENTRE, 0.0174, np.diag([2e-5, 4e-5, 5e-5]))
LEVEL = np.diag([1.0, -1.0, -1.0])  # nose along x, belly down, in a frame with z up
RATE, FLAP = 200.0, 12.5
FILTER = LowPass(40.0)


def seen_from(position: Array, rotation: Array) -> Array:
    """Tracks [T, M, 3] of a body whose centre of mass is at ``position``."""
    return np.asarray(position[:, None] + np.einsum("tij,mj->tmi", rotation, MARKERS - CENTRE))


def still(frames: int, rotation: Array = LEVEL) -> Array:
    return seen_from(np.tile([0.3, -2.0, 1.5], (frames, 1)), np.broadcast_to(rotation, (frames, 3, 3)))


def pitched(angle: float) -> Array:
    return np.asarray(Rotation.from_euler("y", -angle).as_matrix() @ LEVEL)


def times(frames: int) -> Array:
    return np.arange(frames) / RATE


def flapping(seed: int, drop: float = 0.05, decay: float = 0.0, common: float = 0.0) -> tuple[FreeFlight, Array]:
    """A flight with a force of three harmonics, and the true force filtered alike."""
    rng, frames = np.random.default_rng(seed), 400
    t = times(frames)
    attitude = [pitched(a) for a in np.radians(70) + np.radians(1) * np.cos(2 * np.pi * FLAP * t)]
    rotation = np.stack(attitude)
    acceleration, position = np.zeros((frames, 3)), np.zeros((frames, 3))
    position[:, 0] = 0.65 * t
    for k, (along, up) in enumerate(((2.0, 6.0), (1.0, 4.0), (0.5, 1.0)), 1):
        w = 2 * np.pi * FLAP * k
        acceleration += np.outer(np.cos(w * t), [along, 0, 0]) + np.outer(np.sin(w * t + k), [0, 0, up])
        position -= (np.outer(np.cos(w * t), [along, 0, 0]) + np.outer(np.sin(w * t + k), [0, 0, up])) / w**2
    force = BODY.mass * np.einsum("tji,tj->ti", rotation, acceleration + np.array([0, 0, GRAVITY]))
    tracks = seen_from(position, rotation)
    tracks += 2e-4 * noise(rng, tracks.shape, float(decay == 0), float(decay > 0), decay)
    tracks += common * rng.standard_normal((frames, 1, 3))
    tracks[rng.random(tracks.shape[:2]) < drop] = np.nan
    return free_flight(t, tracks, BODY, FILTER), kernels(FILTER, RATE).apply(force, 0)


@pytest.mark.parametrize("pitch", [0.0, 0.6, 1.4])
def test_at_rest_the_force_is_the_weight_upwards(pitch: float) -> None:
    flight = free_flight(times(120), still(120, pitched(pitch)), BODY, FILTER)
    weight = BODY.mass * GRAVITY
    middle = flight.force[60]
    np.testing.assert_allclose(middle, [weight * np.sin(pitch), 0, -weight * np.cos(pitch)], atol=1e-9)
    assert flight.pitch[60] == pytest.approx(pitch, abs=1e-9)


def test_free_fall_needs_no_force() -> None:
    t = times(120)
    position = np.outer(t, [1.0, 0.5, 2.0]) - np.outer(0.5 * GRAVITY * t**2, [0, 0, 1])
    tracks = seen_from(position, np.broadcast_to(pitched(0.3), (120, 3, 3)))
    flight = free_flight(t, tracks, BODY, FILTER)
    np.testing.assert_allclose(flight.force[60], 0, atol=1e-9)
    np.testing.assert_allclose(flight.velocity[60], [1.0, 0.5, 2.0 - GRAVITY * t[60]], atol=1e-9)


def test_spinning_about_a_place_off_the_centre_of_mass_needs_the_centripetal_force() -> None:
    """Radius 0.1 m along the nose, spin 6 rad/s about the vertical: the force points from nose to tail."""
    t, spin, radius = times(300), 6.0, 0.1
    turns = np.stack([Rotation.from_euler("z", spin * x).as_matrix() @ LEVEL for x in t])
    flight = free_flight(t, seen_from(radius * turns[:, :, 0], turns), BODY, FILTER)
    expected = [-BODY.mass * spin**2 * radius, 0, -BODY.mass * GRAVITY]
    np.testing.assert_allclose(flight.force[150], expected, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(flight.rate[150], [0, 0, -spin], atol=1e-4)  # z down: the other way round
    assert flight.moment is not None
    np.testing.assert_allclose(flight.moment[150], 0, atol=1e-7)


def test_a_turn_about_a_principal_axis_gives_inertia_times_acceleration() -> None:
    t, w, size = times(300), 2 * np.pi * 5.0, 0.05
    turns = np.stack([pitched(0.2 + size * np.sin(w * x)) for x in t])
    flight = free_flight(t, seen_from(np.zeros((300, 3)), turns), BODY, FILTER)
    # Nose up is positive about the body's y axis (to the right).
    expected = -4e-5 * size * w**2 * np.sin(w * t)
    assert flight.moment is not None
    inner = slice(50, 250)
    np.testing.assert_allclose(flight.moment[inner, 1], expected[inner], atol=2e-3 * np.abs(expected).max())


def test_a_body_spinning_about_no_principal_axis_needs_the_gyroscopic_moment() -> None:
    """A steady spin about an axis between x and z: omega x I omega alone."""
    t, spin = times(300), 5.0
    axis = np.array([0.6, 0.0, 0.8])
    turns = np.stack([LEVEL @ Rotation.from_rotvec(spin * x * axis).as_matrix() for x in t])
    flight = free_flight(t, seen_from(np.zeros((300, 3)), turns), BODY, FILTER)
    assert BODY.inertia is not None
    expected = np.cross(spin * axis, BODY.inertia @ (spin * axis))
    assert np.abs(expected[1]) > 1e-5
    assert flight.moment is not None
    np.testing.assert_allclose(flight.moment[150], expected, atol=1e-3 * np.abs(expected[1]))


def test_kernels_have_the_gain_of_the_filter_and_exact_derivatives() -> None:
    windows = kernels(FILTER, RATE)
    n = windows.reach
    sections = signal.butter(4, 40.0, fs=RATE, output="sos")
    for frequency in (5.0, 12.5, 25.0, 37.5, 50.0):
        gain = float(np.abs(signal.sosfreqz(sections, [frequency], fs=RATE)[1][0]) ** 2)
        wave = np.exp(2j * np.pi * frequency * np.arange(-n, n + 1) / RATE)
        for d in range(3):
            found = windows.taps[d] @ wave / (2j * np.pi * frequency) ** d
            assert found == pytest.approx(gain, abs=2e-3)


@pytest.mark.parametrize(
    "case",
    [{}, {"drop": 0.3}, {"decay": 0.6}, {"common": 1.5e-4}],
    ids=["white", "many gaps", "coloured", "common to all"],
)
def test_standard_deviations_agree_with_the_scatter(case: dict[str, float]) -> None:
    """Chi-square over instants and flights: the mean of (error / standard deviation)^2 is one."""
    squares = []
    for seed in range(16):
        flight, exact = flapping(seed, **case)
        squares.append(np.nanmean(((flight.force - exact) / flight.force_deviation) ** 2, axis=0))
    mean = np.mean(squares, axis=0)
    assert np.all(mean > 0.85), mean
    assert np.all(mean < 1.18), mean


def test_standard_deviations_include_the_attitude() -> None:
    """Markers close together and a low cut-off: most of the error is the weight seen in a body that seems tilted."""
    shape, squares = 0.2 * MARKERS, []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        tracks = np.tile(shape @ LEVEL.T, (800, 1, 1)) + 2e-4 * rng.standard_normal((800, 6, 3))
        flight = free_flight(times(800), tracks, Body(shape, 0.2 * CENTRE, BODY.mass), LowPass(8.0))
        squares.append(np.nanmean((flight.force[:, :2] / flight.force_deviation[:, :2]) ** 2, axis=0))
    mean = np.mean(squares, axis=0)
    assert np.all(mean > 0.7), mean
    assert np.all(mean < 1.4), mean


def test_marker_noise_is_estimated_from_rigidity_and_common_noise_from_the_scatter() -> None:
    apart, _ = flapping(0)
    assert apart.noise.deviation == pytest.approx(2e-4, rel=0.05)
    assert apart.noise.common < 1.15
    coloured, _ = flapping(0, decay=0.6)
    np.testing.assert_allclose(coloured.noise.correlation[:3], [1, 0.6, 0.36], atol=0.08)
    shared, _ = flapping(0, common=1.5e-4)
    assert shared.noise.deviation == pytest.approx(2e-4, rel=0.05)
    assert shared.noise.common > 1.5
    assert any("scatters" in remark for remark in shared.remarks)


def test_poses_survive_missing_and_swapped_markers_and_a_shape_measured_badly() -> None:
    rng = np.random.default_rng(3)
    turns = np.stack([pitched(a) for a in np.linspace(0.2, 0.5, 200)])
    tracks = seen_from(np.zeros((200, 3)), turns) + 1e-4 * rng.standard_normal((200, 6, 3))
    tracks[rng.random((200, 6)) < 0.1] = np.nan
    tracks[40, [0, 3]] = tracks[40, [3, 0]]
    found = poses(tracks, MARKERS + 1e-3 * rng.standard_normal(MARKERS.shape))
    assert 1 <= found.rejected <= 3
    size = np.sqrt(np.nanmean(found.residuals**2))
    assert size < 1.1e-4
    error = Rotation.from_matrix(
        np.swapaxes(found.rotation[found.seen.sum(axis=1) > 3], 1, 2) @ turns[found.seen.sum(axis=1) > 3]
    )
    angle = error.as_rotvec()
    assert np.degrees(np.abs(angle - angle.mean(axis=0)).max()) < 0.5


def test_the_recording_counts_from_the_start_of_a_beat() -> None:
    flight, _ = flapping(0, drop=0.0)
    made = recording(flight, "hover", FLAP, 0.013, 101325.0, 293.15)
    first = flight.times[np.isfinite(flight.force[:, 0])][0]
    assert 0 <= made.times[0] < 1 / FLAP
    beats = (made.times[0] - (first - 0.013)) * FLAP
    assert beats == pytest.approx(round(beats), abs=1e-9)
    assert made.forces == ("x", "z")
    assert made.low_pass == FILTER
    assert made.rig == "free_flight"
    assert made.condition.airspeed == pytest.approx(0.65, abs=0.02)
    assert np.degrees(made.condition.angle_of_attack) == pytest.approx(70, abs=0.5)
    assert made.standard_deviation is not None
    assert made.standard_deviation.shape == (2,)
    np.testing.assert_allclose(made.values, flight.force[np.isfinite(flight.force[:, 0])][:, [0, 2]])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"frames": 40}, ("40 frames", "51")),
        ({"cutoff": 95.0}, ("95 Hz", "90 Hz")),
        ({"markers": 2}, ("2 markers", "3 that do not")),
        ({"line": True}, ("one line",)),
        ({"uneven": True}, ("even within 1 %", "empty cells")),
    ],
)
def test_tracks_that_cannot_give_forces_are_refused(change: dict[str, Any], words: tuple[str, ...]) -> None:
    frames, count = change.get("frames", 120), change.get("markers", 6)
    t, tracks = times(frames), still(frames)[:, :count]
    shape = MARKERS[:count].copy()
    if "line" in change:
        shape[:, 1:] = 0
    if "uneven" in change:
        t = np.delete(t, 30)
        tracks = np.delete(tracks, 30, axis=0)
    with pytest.raises(ValueError, match=words[0]) as error:
        free_flight(t, tracks, Body(shape, CENTRE, 0.0174), LowPass(change.get("cutoff", 40.0)))
    assert all(word in str(error.value) for word in words)


@pytest.mark.parametrize(
    ("tracks", "body", "message"),
    [
        (1e3, 1.0, "the tracks are 1000 times those in the body file.*millimetres in the tracks"),
        (1e2, 1.0, "100 times.*centimetres in the tracks"),
        (10.0, 1.0, "10 times.*decimetres in the tracks"),
        (3.2808, 1.0, "3.281 times.*the tracks or the body file are in another unit"),
        (1.0, 10.0, "0.1 times.*decimetres in the body file"),
        (1.0, 1e3, r"body file spread over 204\.5 m; it must be at most 10 m.*not millimetres"),
        (0.7, 1.0, "0.7 times"),
    ],
)
def test_other_units_than_metres_are_refused(tracks: float, body: float, message: str) -> None:
    given = Body(body * MARKERS, body * CENTRE, 0.0174)
    with pytest.raises(ValueError, match=message):
        free_flight(times(120), tracks * still(120), given, FILTER)


def test_a_scale_that_is_a_little_off_is_remarked_on() -> None:
    message = [free_flight(times(120), scale * still(120), BODY, FILTER).remarks for scale in (1.0, 1.03, 1.1)]
    assert message[:2] == [(), ()]
    assert message[2][:1] == (
        "distances between markers in the tracks are 1.1 times those in the body file; check the scale",
    )


def test_swapped_markers_do_not_change_the_scale() -> None:
    tracks = still(120)
    tracks[:30, [0, 4]] = tracks[:30, [4, 0]]
    assert not any(
        "distances between markers" in remark for remark in free_flight(times(120), tracks, BODY, FILTER).remarks
    )


@pytest.mark.parametrize(("speed", "fine"), [(99.0, True), (101.0, False)])
def test_speeds_above_those_of_a_dataset_are_refused(speed: float, fine: bool) -> None:
    assert VehicleRecordingFile.model_json_schema()["properties"]["airspeed_m_s"]["maximum"] == 100
    tracks = seen_from(np.outer(times(120), [0, speed, 0]), np.broadcast_to(LEVEL, (120, 3, 3)))
    if fine:
        free_flight(times(120), tracks, BODY, FILTER)
        return
    with pytest.raises(ValueError, match=r"flies at 101 m/s; it must be at most 100 m/s.*metres.*seconds"):
        free_flight(times(120), tracks, BODY, FILTER)
