"""A drive that gives way to its load: the rods' place, the law of the motor, the order, and what it does to a beat."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from tests.sim.kernels.marching import driven, march, order
from wingfit.records import Condition
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import Trace
from wingfit.sim.kernels.motor import AVERAGING, DROOP, FOLLOWING, HOLDING, MOTOR, rods_of
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.solver.scene import at_rest
from wingfit.sim.solver.settle import Subject
from wingfit.sim.solver.simulate import periodic_beats
from wingfit.sim.virtual_rigs.campaign import robird_wing, tunnel, vacuum
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.drive import RodDrive, flap_angle
from wingfit.sim.wing.genes import lanes, wing_genes
from wingfit.sim.wing.load_recovery import from_motion
from wingfit.sim.wing.outputs import Outputs
from wingfit.sim.wing.structure import build

Array = npt.NDArray[np.float64]
VACUUM, TUNNEL = replace(vacuum(0.01, 0.05, 3.0), gravity=0.0), tunnel(0.05, 3.0, 6.0)
FOLLOWS, MEASURES = 0.04, 0.02  # s
STRUCTURE = build(robird_wing(), Division.parse("4"))
GENES = wing_genes({})
MOTOR_ORDER = 2


def scene_of(droop: Array | float, condition: Condition) -> WingScene:
    """The Robird's wing with nominal genes, whose motor loses ``droop`` (1/W) of its speed per power."""
    genome = [gene.nominal for gene in GENES]
    scene = WingScene.of(STRUCTURE, condition, lanes(STRUCTURE, GENES, np.array([genome])))
    scene.motor = np.zeros((MOTOR, LANES))
    scene.motor[DROOP], scene.motor[FOLLOWING] = droop, 1 / FOLLOWS
    scene.motor[HOLDING], scene.motor[AVERAGING] = scene.angular_rate / FOLLOWS, 1 / MEASURES
    return scene


def two_beats(scene: WingScene, steps: int) -> Trace:
    """From rest, the second at full amplitude."""
    table = driven(STRUCTURE, scene.condition, steps, 2, compliant=len(scene.motor) > 0)
    group = scene.frozen()
    return march(STRUCTURE, group, scene.setting(steps), at_rest(STRUCTURE, len(group.laws.size)), 2 * steps, table)


def test_rods_are_where_the_profile_has_them_later() -> None:
    """Angle, rate and acceleration of phi(t + tau(t)) by the chain rule; their series are cut at the fourth order."""
    drive, omega, rng = RodDrive.of(robird_wing().drive, 0.1, LANES), 20.0, np.random.default_rng(1)
    psi, errors = 1.3, []
    for largest in (4e-3, 2e-3):
        tau = largest * np.linspace(-1.0, 1.0, LANES)
        states, turning = np.zeros((5, LANES)), np.zeros((5, LANES))
        states[2], states[3], turning[3] = tau, rng.normal(size=LANES), rng.normal(size=LANES)
        found = np.zeros((2, 3, LANES))
        profile = np.zeros((2, 6, LANES))
        profile[:, :5] = drive.angles(np.array([psi]))[0] * omega ** np.arange(5.0)[:, None]
        profile[:, 5] = 7.0  # the stage's share, in the acceleration alone
        rods_of(profile, states, turning, found)
        found[:, 2] -= 7.0 * (1 + states[3]) ** 2
        later = drive.angles(psi + omega * tau)[np.arange(LANES), :, :3, np.arange(LANES)]  # [W, 2, 3]
        angle, rate, bend = np.moveaxis(later, 2, 0) * omega ** np.arange(3.0)[:, None, None]
        pace = 1 + states[3][:, None]
        expected = np.stack([angle, rate * pace, bend * pace**2 + rate * turning[3][:, None]])
        errors.append(np.abs(found - np.moveaxis(expected, [0, 1, 2], [1, 2, 0])).max(axis=(0, 2)))
    assert np.all(errors[1] < 2e-5 * np.array([1.0, omega, omega**2]))
    np.testing.assert_allclose(np.log2(errors[0] / errors[1]), [5.0, 4.0, 3.0], atol=0.6)


def test_a_motor_that_never_gives_way_is_the_prescribed_drive() -> None:
    stiff, without = scene_of(0.0, TUNNEL), scene_of(0.0, TUNNEL)
    without.motor = without.motor[:0]
    expected, found = two_beats(without, 96), two_beats(stiff, 96)
    for a, b in ((expected.tracks, found.tracks), (expected.energy, found.energy), (expected.power, found.power)):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(found.z[:, :2], 0.0)
    assert np.abs(found.z[:, 2]).max() > 0, "it knows its load"


def test_lanes_have_motors_of_their_own() -> None:
    droop = np.linspace(0.0, 0.01, LANES)
    found, turned = (two_beats(scene_of(d, TUNNEL), 64) for d in (droop, droop[::-1].copy()))
    assert np.array_equal(found.tracks, turned.tracks[..., ::-1])
    lag = np.abs(found.z[:, 0]).max(axis=0)
    assert np.all(np.diff(lag) > 0)


@pytest.fixture(scope="module")
def beat() -> Outputs:
    """A periodic beat, and the motor's states in it."""

    def scene(genomes: Array) -> WingScene:  # noqa: ARG001 (one individual)
        return scene_of(0.005, TUNNEL)

    nominal = np.array([[gene.nominal for gene in GENES]])
    (found,) = periodic_beats(
        Subject(STRUCTURE, TUNNEL, scene), nominal, Numerics(steps=480, periodic=1e-7, max_beats=90), with_motion=True
    )
    assert found.motion is not None, found.reason
    outputs = from_motion(scene(nominal), found.motion)
    np.testing.assert_allclose([m.power for m in outputs.motors], found.power[:, 1:3].T, atol=1e-10)
    STATES[:] = list(found.motion.z.T)
    return outputs


STATES: list[Array] = []


def test_motor_obeys_its_law(beat: Outputs) -> None:
    """tau' = sigma, sigma' = -(d (P - P_m) + sigma) / T - k tau, P_m' = (P - P_m) f, with the power that is drawn."""
    tau, sigma, mean = STATES
    load = sum(motor.power for motor in beat.motors)
    n, f = len(tau), TUNNEL.flap_frequency
    k = np.fft.rfftfreq(n, 1 / (n * f)) * 2j * np.pi
    rates = [np.fft.irfft(k * np.fft.rfft(series), n) for series in (tau, sigma, mean)]
    expected = (
        sigma,
        -(0.005 * (load - mean) + sigma) / FOLLOWS - 2 * np.pi * f / FOLLOWS * tau,
        (load - mean) / MEASURES,
    )
    for rate, wanted in zip(rates, expected, strict=True):
        assert np.abs(rate - wanted).max() < 0.01 * np.abs(wanted).max()
    assert np.mean(load) == pytest.approx(np.mean(mean), rel=1e-3), "the mean load is what it has learnt"


def test_rods_come_late_by_what_the_motor_says(beat: Outputs) -> None:
    tau, sigma, _ = STATES
    omega = 2 * np.pi * TUNNEL.flap_frequency
    angle, rate = flap_angle(robird_wing().drive, 2 * np.pi * beat.phase + omega * tau)[:, :2].T
    np.testing.assert_allclose(beat.motors[0].angle, angle, atol=1e-5)
    np.testing.assert_allclose(beat.motors[0].rate, omega * rate * (1 + sigma), atol=1e-4 * omega)
    assert abs(beat.balance.relative_closing) < 2e-3


def test_drive_is_slow_where_power_is_drawn() -> None:
    """A motor that follows at once and is hardly held: where more than the mean is drawn it falls behind."""
    scene = scene_of(0.002, TUNNEL)
    scene.motor[FOLLOWING], scene.motor[HOLDING] = 1 / 0.002, 1.0
    trace = two_beats(scene, 480)
    load = trace.power[480:, 1:3, 0].sum(axis=1)
    sigma, mean = trace.z[480:, 1, 0], trace.z[480:, 2, 0]
    assert np.corrcoef(load - mean, sigma)[0, 1] < -0.9


def test_order_with_a_motor_that_gives_way() -> None:
    """Two beats from rest in vacuum: the motor's law is not in the matrix, and so the second order; micrometres."""
    tracks, states = {}, {}
    for steps in (200, 400, 800):
        trace = two_beats(scene_of(0.02, VACUUM), steps)
        tracks[steps], states[steps] = trace.tracks[:: steps // 200, ..., 0], trace.z[:: steps // 200, :, 0]
    assert np.abs(tracks[400] - tracks[800]).max() < 2e-6
    for found in (tracks, states):
        errors = [float(np.abs(found[a] - found[b]).max()) for a, b in ((200, 400), (400, 800))]
        assert order(errors) > MOTOR_ORDER - 0.25
