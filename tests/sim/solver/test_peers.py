"""The simulator against an independent right-hand side under scipy, and against Exudyn with the same spring law."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from tests.oracles.engines import (
    SIZE,
    PeerWing,
    air_loads,
    at_rest,
    compare,
    exudyn_engine,
    marker_tracks,
    peer_wing,
    put_rods,
    right_hand_side,
    rod_motion,
    scipy_engine,
    sparsity,
    spring_loads,
)
from wingfit.records import Condition
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import new_work
from wingfit.sim.kernels.integrate import forces
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.solver.scene import setting
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing
from wingfit.sim.wing.drive import flap_angle
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.genes import lanes

Array = npt.NDArray[np.float64]

FINE = 1920  # steps a beat
EXUDYN = "exudyn is not installed; install the extra: pip install 'wingfit[peers]'"
ALL = [(division, medium) for division in ("4", "11") for medium in ("vacuum", "air")]


def model(division: str) -> FlexibleWing:
    """Integrated finely, and stopped after the second beat from rest."""
    numerics = Numerics(steps=FINE, max_beats=2, periodic=1e9)
    return FlexibleWing(robird_wing(), division, numerics=numerics)


def nominal(wing: FlexibleWing) -> Array:
    return np.array([gene.nominal for gene in wing.genes])


def second_beat(division: str, condition: Condition) -> Array:
    """Tracks [FINE, M, 3] of the simulator in the second beat from rest."""
    wing = model(division)
    beat = wing.beat(nominal(wing), blank_recording(wing.wing, condition))
    assert beat.reason is None
    assert beat.beats == 2
    return np.asarray(beat.tracks)


def peer(division: str, condition: Condition) -> PeerWing:
    wing = model(division)
    return peer_wing(wing.structure, wing.genes, nominal(wing), condition)


def farthest(a: Array, b: Array) -> float:
    """Largest distance of a marker, mm."""
    return float(1e3 * np.linalg.norm(a - b, axis=-1).max())


@pytest.mark.parametrize(("division", "medium"), ALL)
def test_two_beats_from_rest_agree_with_the_independent_equations(division: str, medium: compare.Medium) -> None:
    condition = compare.CONDITIONS[medium]
    wing = peer(division, condition)
    run = scipy_engine.simulate(wing, "Radau", 1e-6, keep=True)
    assert run.between is not None
    times = (1 + np.arange(FINE) / FINE) / condition.flap_frequency
    theirs = marker_tracks(wing, run.between(times).T)
    assert np.ptp(theirs[:, :, 2], axis=0).max() > 0.1, "the tip must have moved"
    assert farthest(second_beat(division, condition), theirs) < 1e-3


def shaken(wing: PeerWing, seed: int, turn_by: float = 0.15, speed: float = 3.0) -> Array:
    """A random state [13 N]: flapped, deformed (rad) and moving (m/s)."""
    rng, n = np.random.default_rng(seed), len(wing.mass)
    y = at_rest(wing).reshape(n, SIZE)
    turn = Rotation.from_rotvec([0.4, 0.0, 0.0])
    y[:, :3] = turn.apply(y[:, :3]) + 1e-3 * rng.normal(size=(n, 3))
    y[:, [4, 5, 6, 3]] = (turn * Rotation.from_rotvec(turn_by * rng.normal(size=(n, 3)))).as_quat()
    y[:, 7:10], y[:, 10:] = speed * rng.normal(size=(n, 3)), 7.0 * speed * rng.normal(size=(n, 3))
    return y.ravel()


def frames(wing: PeerWing, state: Array, t: float) -> tuple[Array, Array, Array, Array]:
    """R, p, v, w of all bodies and rods, from a state [13 N]."""
    x, n = state.reshape(-1, SIZE), len(wing.mass)
    R, p, v, w = np.zeros((n + 2, 3, 3)), np.zeros((n + 2, 3)), np.zeros((n + 2, 3)), np.zeros((n + 2, 3))
    R[:n], p[:n] = Rotation.from_quat(x[:, [4, 5, 6, 3]]).as_matrix(), x[:, :3]
    v[:n], w[:n] = x[:, 7:10], x[:, 10:]
    put_rods(wing, t, R, p, v, w)
    return R, p, v, w


def kernels_accelerations(ours: FlexibleWing, wing: PeerWing, condition: Condition, state: Array, t: float) -> Array:
    """v' and w' [N, 6] in the world, from the kernels' wrenches by M V' = W, V the twist in the body."""
    n, w = len(wing.mass), ours.structure.wiring
    R, p, v, omega = frames(wing, state, t)
    group = lanes(ours.structure, ours.genes, nominal(ours)[None])
    here = setting(condition, FINE)._replace(wind=np.repeat(wing.wind[:, None], LANES, axis=1))
    work = new_work(w, here, group)
    twist = np.concatenate([np.einsum("nji,nj->ni", R, omega), np.einsum("nji,nj->ni", R, v)], axis=1)
    for array, value in ((work.R, R.reshape(n + 2, 9)), (work.p, p), (work.V, twist)):
        array[:] = np.repeat(value[..., None], LANES, axis=-1)
    forces(w, here, group, work)
    wrench = work.wrench[:n, :, 0]
    turning = np.linalg.solve(wing.inertia, wrench[:, :3, None])[..., 0]
    moving = wrench[:, 3:] / wing.mass[:, None] + np.cross(twist[:n, :3], twist[:n, 3:])
    return np.concatenate([np.einsum("nij,nj->ni", R[:n], a) for a in (moving, turning)], axis=1)


def assert_same_accelerations(ours: FlexibleWing, wing: PeerWing, condition: Condition, state: Array) -> None:
    expected = kernels_accelerations(ours, wing, condition, state, 0.21)
    found = right_hand_side(wing, 0.21, state).reshape(-1, SIZE)[:, 7:]
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(found / scale, expected / scale, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("division", "medium"), [*ALL, ("24", "air")])
def test_accelerations_in_random_states_are_the_kernels(division: str, medium: compare.Medium) -> None:
    condition = compare.CONDITIONS[medium]
    wing = peer(division, condition)
    assert_same_accelerations(model(division), wing, condition, shaken(wing, int(division)))


@pytest.mark.parametrize("ahead", [0.3, -0.3, -3.0])
def test_accelerations_agree_where_the_flow_turns(ahead: float) -> None:
    """Air from below, a few degrees off the normal, where the lift changes its side; and from behind."""
    condition, ours = compare.CONDITIONS["air"], model("11")
    below = Rotation.from_rotvec([0.4, 0.0, 0.0]).apply([0.0, 0.0, 7.0])
    wing = peer("11", condition)._replace(wind=below + np.array([ahead, 0.0, 0.0]))
    assert_same_accelerations(ours, wing, condition, shaken(wing, 5, turn_by=0.02, speed=0.05))


def spring_energy(wing: PeerWing, R: Array, p: Array) -> float:
    """V_o + V_t as printed (thesis Eqs. 5-7), summed over the connectors."""
    total = 0.0
    for c, (i, j) in enumerate(zip(wing.first, wing.second, strict=True)):
        K_o, K_t = np.diag(wing.stiffness[c, :3]), np.diag(wing.stiffness[c, 3:])
        G_o, Q = 0.5 * np.trace(K_o) * np.eye(3) - K_o, R[i].T @ R[j]
        d = R[i].T @ (p[j] + R[j] @ wing.b[c] - p[i]) - wing.a[c]
        total += np.trace(G_o) - np.trace(G_o @ Q) + 0.25 * d @ (K_t + Q @ K_t @ Q.T) @ d
    return float(total)


def test_spring_loads_are_minus_the_gradient_of_the_energies() -> None:
    wing = peer("4", compare.CONDITIONS["vacuum"])
    wing = wing._replace(damping=np.zeros_like(wing.damping))
    n, h = len(wing.mass), 1e-6
    R, p, _, _ = frames(wing, shaken(wing, 7), 0.21)
    still = np.zeros((n + 2, 3))
    load = np.zeros((n + 2, 6))
    spring_loads(wing, R, p, still, still, load)
    slope = np.zeros((n + 2, 6))
    for body in range(n + 2):
        for axis in range(6):
            ends = []
            for step in (h, -h):
                R1, p1, by = R.copy(), p.copy(), step * np.eye(3)[axis % 3]
                if axis < 3:
                    p1[body] += by
                else:
                    R1[body] = Rotation.from_rotvec(by).as_matrix() @ R[body]
                ends.append(spring_energy(wing, R1, p1))
            slope[body, axis] = (ends[0] - ends[1]) / (2 * h)
    np.testing.assert_allclose(load, -slope, rtol=0, atol=1e-6 * np.abs(slope).max())


def test_drive_of_the_peers_is_that_of_the_rig() -> None:
    """After the ramp the rods follow the linkage; during it they start from rest without a jump in rate."""
    wing, drive = peer("4", compare.CONDITIONS["air"]), robird_wing().drive
    for rod in (0, 1):
        for t in (0.4, 0.55):
            angle, slope = flap_angle(drive, wing.omega * t - wing.lag[rod])[:2]
            assert rod_motion(wing, t, rod) == pytest.approx((angle, wing.omega * slope), rel=1e-10)
        assert rod_motion(wing, 0.0, rod) == (0.0, 0.0)
        h, t = 1e-6, 0.17
        rate = (rod_motion(wing, t + h, rod)[0] - rod_motion(wing, t - h, rod)[0]) / (2 * h)
        assert rod_motion(wing, t, rod)[1] == pytest.approx(rate, rel=1e-7)


def test_no_dependence_is_missing_from_the_sparsity() -> None:
    wing = peer("11", compare.CONDITIONS["air"])
    y = shaken(wing, 3)
    shifted = y[:, None] + 1e-6 * np.eye(len(y))
    change = right_hand_side(wing, 0.21, shifted) - right_hand_side(wing, 0.21, y)[:, None]
    pattern = sparsity(wing).toarray()
    # a quaternion's length drops out of its own rotation, so not every entry need be there
    assert not np.any((np.abs(change) > 1e-12) & ~pattern)
    assert pattern.mean() < 0.5


@pytest.mark.parametrize("medium", ["vacuum", "air"])
def test_exudyn_under_the_same_spring_law_agrees(medium: compare.Medium) -> None:
    """4 bodies at 480 steps a beat: of second order, 0.02 mm of its own error is left."""
    pytest.importorskip("exudyn", reason=EXUDYN)
    condition = compare.CONDITIONS[medium]
    run = exudyn_engine.simulate(peer("4", condition), exudyn_engine.Settings(480, "energy"))
    ours = second_beat("4", condition)[:: FINE // exudyn_engine.SAMPLES]
    np.testing.assert_allclose(
        run.times[exudyn_engine.SAMPLES : 2 * exudyn_engine.SAMPLES] * condition.flap_frequency - 1,
        np.arange(60) / 60,
        atol=1e-9,
    )
    assert farthest(run.tracks[exudyn_engine.SAMPLES : 2 * exudyn_engine.SAMPLES], ours) < 0.1


def test_exudyns_user_law_is_that_of_the_independent_equations() -> None:
    """One spring at a time, undamped: force on the first body, and moment on the second about its frame's origin."""
    pytest.importorskip("exudyn", reason=EXUDYN)
    wing, none = peer("11", compare.CONDITIONS["vacuum"]), np.zeros(6)
    R, p, _, _ = frames(wing, shaken(wing, 9), 0.21)
    still = np.zeros_like(p)
    for c, (i, j) in enumerate(zip(wing.first, wing.second, strict=True)):
        load, one = np.zeros((len(p), 6)), slice(c, c + 1)
        alone = wing._replace(first=wing.first[one], second=wing.second[one], a=wing.a[one], b=wing.b[one])
        alone = alone._replace(stiffness=wing.stiffness[one], damping=none[None])
        spring_loads(alone, R, p, still, still, load)
        arm = R[j] @ wing.b[c]
        d = R[i].T @ (p[j] + arm - p[i]) - wing.a[c]
        angles = Rotation.from_matrix(R[i].T @ R[j]).as_euler("XYZ")
        found = exudyn_engine.energy_wrench(wing.stiffness[c], none, d, angles, np.zeros(3), np.zeros(3))
        expected = np.concatenate([load[i, :3] @ R[i], -(load[j, 3:] - np.cross(arm, load[j, :3])) @ R[i]])
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_air_on_exudyns_angles_does_the_work_of_the_air_on_the_bodies() -> None:
    """Virtual work: the generalised force on an angle is the moment along the rotation that the angle makes."""
    pytest.importorskip("exudyn", reason=EXUDYN)
    wing, rng, h = peer("11", compare.CONDITIONS["air"]), np.random.default_rng(4), 1e-6
    n = len(wing.mass)
    q, q_t = 0.3 * rng.normal(size=(n, 6)), rng.normal(size=(n, 6)) * [1, 1, 1, 10, 10, 10]
    R = Rotation.from_euler("XYZ", q[:, 3:])
    turns = [Rotation.from_euler("XYZ", q[:, 3:] + h * e) * R.inv() for e in np.eye(3)]
    axes = np.stack([turn.as_rotvec() / h for turn in turns], axis=1)
    load = np.zeros((n, 6))
    air_loads(wing, R.as_matrix(), q_t[:, :3].copy(), np.einsum("nk,nki->ni", q_t[:, 3:], axes), load)
    expected = np.concatenate([load[:, :3], np.einsum("nki,ni->nk", axes, load[:, 3:])], axis=1)
    found = exudyn_engine.air_on_angles(wing, q.ravel(), q_t.ravel()).reshape(n, 6)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5 * np.abs(expected).max(axis=0).min())


def test_cost_in_scipy_is_measured_at_the_tolerance() -> None:
    row = compare.scipy_case("4", "vacuum", 0.1)
    assert row["error_mm"] < 0.1
    assert 0 < row["cpu_ms_per_beat"] < 5000
    assert row["method"] in scipy_engine.METHODS


def test_cost_in_exudyn_is_measured_at_the_tolerance_and_grows_with_it() -> None:
    pytest.importorskip("exudyn", reason=EXUDYN)
    rough, fine = compare.exudyn_case("4", "vacuum", 1.0), compare.exudyn_case("4", "vacuum", 0.05)
    assert rough["error_mm"] < 1.0
    assert fine["error_mm"] < 0.05
    assert fine["settings"]["steps_per_beat"] > rough["settings"]["steps_per_beat"]


def test_out_of_time_is_reported_and_not_waited_for() -> None:
    row = compare.scipy_case("24", "air", 0.1, seconds=0.2)
    assert row["cpu_ms_per_beat"] is None
    assert "0.2 s; allow more time" in row["note"]


def test_unknown_cases_are_refused() -> None:
    with pytest.raises(ValueError, match="engine 'drake' is unknown; give one of scipy, exudyn"):
        compare.case("drake", "4", "air", 0.1, 1.0)
    with pytest.raises(ValueError, match="tolerance is 0 mm; it must be above 0 mm"):
        compare.case("scipy", "4", "air", 0.0, 1.0)


def test_command_prints_one_line_of_json() -> None:
    command = [
        sys.executable,
        "-m",
        "benchmarks.peers",
        "--division",
        "4",
        "--engine",
        "scipy",
        "--tolerance-mm",
        "1",
        "--json",
    ]
    root = Path(__file__).parents[3]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, env=os.environ.copy())
    assert done.returncode == 0, done.stderr
    (row,) = json.loads(done.stdout)
    assert row["bodies"] == 4
    assert row["cpu_ms_per_beat"] > 0
