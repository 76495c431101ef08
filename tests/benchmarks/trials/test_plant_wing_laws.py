"""Each law of the plant of the concealed trials against a closed form."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from benchmarks.concealed.plant.wing.air_loads import air_loads
from benchmarks.concealed.plant.wing.build import Draft, rig_of
from benchmarks.concealed.plant.wing.joint_loads import dead_zone, joint_loads, remembered_loads
from benchmarks.concealed.plant.wing.linkage import angles
from benchmarks.concealed.plant.wing.point_loads import point_loads
from benchmarks.concealed.plant.wing.rig import AIR_LAWS, CARRIED, LAG, LAG_RATE, STALL, VORTEX, Motion, Rig
from benchmarks.concealed.plant.wing_effects.catalogue import KINDS
from benchmarks.concealed.plant.wing_effects.hidden import Hidden
from wingfit.records import Condition
from wingfit.sim.virtual_rigs.campaign import robird_wing, tunnel, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing

Array = npt.NDArray[np.float64]

WING = robird_wing()
NOMINAL = {gene.name: gene.nominal for gene in FlexibleWing(WING, "4").genes}
THIN, STREAM = vacuum(10.0, 0.12, 4.0), tunnel(0.05, 3.5, 6.0)


def rig(hidden: Hidden | None = None, condition: Condition = STREAM, **changes: Any) -> Rig:
    draft = Draft(WING, "4", NOMINAL, condition)
    (hidden or Hidden()).put_into(draft)
    return rig_of(draft)._replace(**changes)


def still(one: Rig) -> Motion:
    n = len(one.mass)
    zero = np.zeros((n + 2, 3))
    places = np.concatenate([one.rest, [one.hinge, one.hinge]])
    return Motion(np.tile(np.eye(3), (n + 2, 1, 1)), places, zero.copy(), zero.copy(), zero.copy(), zero.copy())


def rotation(vector: Array) -> Array:
    x, y, z = vector
    angle = float(np.linalg.norm(vector)) or 1e-300
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) / angle
    return np.asarray(np.eye(3) + math.sin(angle) * skew + (1 - math.cos(angle)) * skew @ skew)


def disturbed(one: Rig, seed: int) -> Motion:
    rng, motion = np.random.default_rng(seed), still(one)
    for n in range(len(motion.p)):
        motion.R[n] = rotation(rng.normal(size=3) * 0.1)
    motion.p[:] += rng.normal(size=motion.p.shape) * 1e-3
    return motion


def stored(one: Rig, m: Motion) -> float:
    """Energy of the springs as the docs have it, in frame A: tr(G) - tr(G Q) + (d.K d + d.Q K Q^T d) / 4."""
    total = 0.0
    for c in range(len(one.first)):
        i, j = one.first[c], one.second[c]
        Q = m.R[i].T @ m.R[j]
        d = m.R[i].T @ (m.p[j] + m.R[j] @ one.b[c] - m.p[i]) - one.a[c]
        K, k = np.diag(one.stiffness[c, 3:]), one.stiffness[c, :3]
        G = np.diag(0.5 * k.sum() - k)
        total += np.trace(G) - np.trace(G @ Q) + 0.25 * d @ (K + Q @ K @ Q.T) @ d
    return float(total)


def test_springs_are_the_gradient_of_their_energy() -> None:
    one = rig()
    motion, load = disturbed(one, 1), np.zeros((6, 6))
    joint_loads(one, motion, load)
    h = 1e-6
    for n in range(4):
        for k in range(6):
            energies = []
            for sign in (1, -1):
                moved = Motion(*(part.copy() for part in motion))
                if k < 3:
                    moved.p[n, k] += sign * h
                else:
                    moved.R[n] = rotation(sign * h * np.eye(3)[k - 3]) @ moved.R[n]
                energies.append(stored(one, moved))
            assert load[n, k] == pytest.approx((energies[1] - energies[0]) / (2 * h), rel=1e-5, abs=1e-4)


@pytest.mark.parametrize("name", ["", "cubic_stiffness", "backlash", "viscoelastic", "hysteresis", "rod_slip"])
def test_joint_forces_balance_and_dampers_dissipate(name: str) -> None:
    one = rig(Hidden.one(name, KINDS[name].typical) if name else None)
    motion = disturbed(one, 2)
    rng = np.random.default_rng(3)
    motion.v[:], motion.w[:] = rng.normal(size=motion.v.shape), rng.normal(size=motion.w.shape)
    load, z = np.zeros((6, 6)), np.zeros(len(one.memory))
    joint_loads(one, motion, load)
    remembered_loads(one, motion, z.copy(), 1e-3, z, load)
    scale = np.abs(load).max()
    assert np.abs(load[:, :3].sum(axis=0)).max() < 1e-12 * scale
    assert np.abs((load[:, 3:] + np.cross(motion.p, load[:, :3])).sum(axis=0)).max() < 1e-12 * scale
    springs = np.zeros((6, 6))
    joint_loads(one._replace(damping=0 * one.damping), motion, springs)
    plain = np.zeros((6, 6))
    joint_loads(one, motion, plain)
    lost = plain - springs
    assert (lost[:, :3] * motion.v).sum() + (lost[:, 3:] * motion.w).sum() < 0


def bent(one: Rig, joint: int, angle: float) -> float:
    """Moment (N m) about x on the second body of a joint that is bent by ``angle`` and not stretched."""
    motion, load = still(one), np.zeros((6, 6))
    i, j = one.first[joint], one.second[joint]
    motion.R[j] = rotation(np.array([angle, 0.0, 0.0]))
    motion.p[j] = motion.p[i] + one.a[joint] - motion.R[j] @ one.b[joint]
    alone = one._replace(first=one.first[[joint]], second=one.second[[joint]], a=one.a[[joint]], b=one.b[[joint]])
    alone = alone._replace(stiffness=one.stiffness[[joint]], damping=one.damping[[joint]], bends=one.bends[[joint]])
    alone = alone._replace(curvature=one.curvature[[joint]], hardening=one.hardening[[joint]], play=one.play[[joint]])
    joint_loads(alone, motion, load)
    return float(load[j, 3])


def test_hardening_adds_its_strength_at_a_radian_over_the_span() -> None:
    one = rig(Hidden.one("cubic_stiffness", 2.5))
    joint = int(np.argmax(one.hardening > 0))
    angle = 0.3 / one.curvature[joint]
    steep = one.hardening[joint]
    assert math.sinh(steep) / steep - 1 == pytest.approx(2.5, rel=1e-9)
    soft = bent(one._replace(hardening=0 * one.hardening), joint, angle)
    hard = bent(one, joint, angle)
    more = math.sinh(0.3 * steep) / (0.3 * steep) - 1
    assert hard - soft == pytest.approx(-one.stiffness[joint, 0] * angle * more, rel=1e-9)
    assert hard < soft < 0


def test_play_has_no_moment_inside_and_the_full_stiffness_outside() -> None:
    assert dead_zone(0.0, 0.01) == pytest.approx(0.0, abs=1e-12)
    assert dead_zone(0.004, 0.01) < 1e-5
    assert dead_zone(0.03, 0.01) == pytest.approx(0.02, rel=1e-6)
    assert dead_zone(-0.03, 0.01) == pytest.approx(-0.02, rel=1e-6)
    one = rig(Hidden.one("backlash", 0.04))
    joint = int(np.argmax(one.play > 0))
    k = one.stiffness[joint, 0]
    assert bent(one, joint, 0.01) == pytest.approx(0.0, abs=1e-3 * k * 0.01)
    assert bent(one, joint, 0.06) == pytest.approx(-k * 0.04, rel=2e-3)


@pytest.mark.parametrize("name", ["viscoelastic", "hysteresis", "rod_slip"])
def test_internal_states_reach_their_limits(name: str) -> None:
    """At a steady rate of turning: a Maxwell branch at r T, a slider at its yield; after a step of 1 ms at once."""
    one = rig(Hidden.one(name, KINDS[name].typical))
    motion = still(one)
    motion.w[:, 0] = np.arange(6.0)
    motion.w[4:] = 0.0
    z, load = np.zeros(len(one.memory)), np.zeros((6, 6))
    remembered_loads(one, motion, z.copy(), 1e-5, z, load)
    rates = motion.w[one.second[one.memory_of], one.memory_axis] - motion.w[one.first[one.memory_of], one.memory_axis]
    assert z == pytest.approx(1e-5 * rates, rel=0.02)
    for _ in range(2000):
        remembered_loads(one, motion, z.copy(), 5e-3, z, load)
    most = rates * one.memory[:, 2] if name == "viscoelastic" else np.sign(rates) * one.memory[:, 2]
    assert z == pytest.approx(most, rel=1e-6)
    load[:] = 0.0
    remembered_loads(one, motion, z.copy(), 5e-3, z, load)
    about_x = one.memory_axis == 0
    expected = np.zeros(6)
    np.add.at(expected, one.second[one.memory_of[about_x]], (-one.memory[:, 1] * z)[about_x])
    np.add.at(expected, one.first[one.memory_of[about_x]], (one.memory[:, 1] * z)[about_x])
    assert load[:, 3] == pytest.approx(expected, abs=1e-12)


def in_air(
    one: Rig, velocity: Array, steps: int = 1, hg: float = 1e-9, old: Array | None = None
) -> tuple[Array, Array]:
    """Loads [6, 6] on a wing that moves as a whole, and the states of the air after ``steps``."""
    motion = still(one)
    motion.v[:] = velocity
    z, load = np.zeros(16) if old is None else old.copy(), np.zeros((6, 6))
    for _ in range(steps):
        load[:] = 0.0
        air_loads(one, motion, z.copy(), hg, z, 0, load)
    return load, z


def laws(values: Mapping[int, float]) -> Array:
    found = np.zeros(AIR_LAWS)
    for key, value in values.items():
        found[key] = value
    return found


def test_affine_lift_and_drag_of_a_wing_that_sinks() -> None:
    one = rig(wind=np.array([6.0, 0.0, 0.0]), gravity=0.0)
    load, _ = in_air(one, np.array([0.0, 0.0, -0.5]))
    q, alpha = 0.5 * one.air * (6.0**2 + 0.5**2) * one.area.sum(), math.atan2(0.5, 6.0)
    lift = q * (NOMINAL["L_a"] * alpha + NOMINAL["L_b"])
    drag = q * (NOMINAL["ID_a"] * alpha + NOMINAL["ID_b"])
    assert load[:, 2].sum() == pytest.approx(lift * math.cos(alpha) + drag * math.sin(alpha), rel=1e-9)
    assert load[:, 0].sum() == pytest.approx(drag * math.cos(alpha) - lift * math.sin(alpha), rel=1e-9)


def test_the_vortex_has_the_measured_coefficients() -> None:
    one = rig(wind=np.array([5.0, 0.0, 5.0]), air_laws=laws({VORTEX: 1.0}))
    load, _ = in_air(one, np.zeros(3))
    q = 0.5 * one.air * 50.0 * one.area.sum()
    lift, drag = 0.225 + 1.58 * math.sin(math.radians(88.65)), 1.92 - 1.55 * math.cos(math.radians(81.98))
    assert load[:, 2].sum() == pytest.approx(q * (lift + drag) * math.sqrt(0.5), rel=1e-6)
    assert load[:, 0].sum() == pytest.approx(q * (drag - lift) * math.sqrt(0.5), rel=1e-6)


def test_lift_after_a_step_follows_wagners_function() -> None:
    """Half of it at once, the rest as half chords are travelled."""
    one = rig(wind=np.array([6.0, 0.0, 0.6]), air_laws=laws({LAG: 1.0, LAG_RATE: 1.0}), remembers=1)
    one = one._replace(coefficients=np.array([4.0, 0.0, 0.0, 0.0]))
    full = in_air(one._replace(air_laws=laws({}), remembers=0), np.zeros(3))[0]
    load, z = in_air(one, np.zeros(3))
    assert load[0, 2] == pytest.approx(0.5 * full[0, 2], rel=0.01)
    seconds = 10 * 0.5 * one.chord[0] / math.hypot(6.0, 0.6)
    load, _ = in_air(one, np.zeros(3), 4000, seconds / 4000, z)
    wagner = 1 - 0.165 * math.exp(-0.41) - 0.335 * math.exp(-3.2)
    assert load[0, 2] == pytest.approx(wagner * full[0, 2], rel=0.01)


def test_stall_reduces_lift_with_a_lag_and_by_kirchhoffs_law() -> None:
    alpha = 0.6
    wind = 6.0 * np.array([math.cos(alpha), 0.0, math.sin(alpha)])
    hidden = Hidden.one("dynamic_stall", 1.0, angle=0.35, delay=1.0)
    one = rig(hidden, wind=wind, coefficients=np.array([4.0, 0.0, 0.0, 0.0]))
    assert one.air_laws[STALL] == 1.0
    full = in_air(one._replace(air_laws=laws({}), remembers=0), np.zeros(3))[0]
    attached = np.zeros(16)
    attached[3::4] = 1.0
    assert in_air(one, np.zeros(3), old=attached)[0][0, 2] == pytest.approx(full[0, 2], rel=1e-6)
    late = in_air(one, np.zeros(3), 3000, 1e-3, attached)[0]
    part = 0.04 + 0.66 * math.exp((0.35 - alpha) / math.radians(2.5))
    assert late[0, 2] == pytest.approx(full[0, 2] * ((1 + math.sqrt(part)) / 2) ** 2, rel=1e-6)


def test_added_mass_resists_normal_acceleration_only() -> None:
    one = rig(air_laws=laws({CARRIED: 1.0}), coefficients=np.zeros(4), wind=np.zeros(3))
    motion, load = still(one), np.zeros((6, 6))
    motion.dv[:] = [3.0, 2.0, 10.0]
    air_loads(one, motion, np.zeros(0), 1e-3, np.zeros(0), 0, load)
    width = one.area / one.chord
    assert load[:4, 2] == pytest.approx(-one.air * math.pi / 4 * one.chord**2 * width * 10.0, rel=1e-12)
    assert np.abs(load[:, :2]).max() == 0.0


def at_point(kind: str, strength: float, velocity: Array, lift: float, **at: float) -> tuple[Array, Rig]:
    """Load (6) on the body at the place, the wing lifted by ``lift`` (m) and moving as a whole."""
    one = rig(Hidden.one(kind, strength, **at))
    motion, load, z = still(one), np.zeros((6, 6)), np.zeros(2)
    motion.p[:, 2] += lift
    motion.v[:] = velocity
    point_loads(one, motion, z.copy(), 1e-9, z, 0, load)
    return load[one.point_body[0]], one


def test_point_loads() -> None:
    slack, _ = at_point("band", 10.0, np.zeros(3), -0.01)
    tight, one = at_point("band", 10.0, np.zeros(3), 0.03)
    assert abs(slack[2]) < 1e-3
    assert tight[:3] == pytest.approx([0.0, 0.0, -0.3], abs=2e-3)
    assert tight[3:] == pytest.approx(np.cross(one.points[0, 1:4], tight[:3]))
    free, one = at_point("stop", 100.0, np.zeros(3), -0.05)
    top = float(one.points[0, 4])
    assert not free.any()
    assert at_point("stop", 100.0, np.zeros(3), top + 0.01)[0][2] == pytest.approx(-100 * 0.01**1.5, rel=1e-6)
    assert at_point("stop", 100.0, np.array([0.0, 0.0, 1.0]), top + 0.01)[0][2] == pytest.approx(-0.15, rel=1e-6)
    braked, _ = at_point("brake", 0.2, np.array([0.0, 3.0, -4.0]), 0.0)
    assert braked[:3] == pytest.approx([0.0, -0.2 * 25 * 3, 0.2 * 25 * 4])


def test_an_appendage_sags_by_its_weight_and_oscillates_at_its_frequency() -> None:
    one = rig(Hidden.one("appendage", 0.01, hertz=8.0))
    motion, load, z = still(one), np.zeros((6, 6)), np.array([0.01, 0.0])
    track = []
    for _ in range(12_000):
        load[:] = 0.0
        point_loads(one, motion, z.copy(), 5e-4, z, 0, load)
        track.append(z[0])
    sag = -one.gravity / (2 * math.pi * 8.0) ** 2
    assert z[0] == pytest.approx(sag, rel=1e-3)
    assert load[one.point_body[0], 2] == pytest.approx(-0.01 * one.gravity, rel=1e-3)
    first = np.array(track[:400]) - sag
    crossings = np.flatnonzero(np.diff(np.sign(first)))
    assert np.diff(crossings).mean() * 5e-4 == pytest.approx(1 / 16, rel=0.03)


def test_a_tooth_is_local_in_the_turn_and_foam_stiffens_with_pressure() -> None:
    drafts = []
    for hidden in (Hidden(), Hidden.one("tooth", 0.02, turn=2.0)):
        draft = Draft(WING, "4", NOMINAL, THIN)
        hidden.put_into(draft)
        drafts.append(draft)
    psi = np.linspace(0, 2 * np.pi, 200)
    bump = angles(drafts[1].rods[:, 0] - drafts[0].rods[:, 0], psi)[:, 0]
    assert abs(psi[np.argmax(bump)] - 2.0) < 0.04
    assert np.ptp(bump) == pytest.approx(0.02, rel=0.02)
    assert np.abs(bump[np.abs(psi - 2.0) > 0.7] - bump[-1]).max() < 2e-4
    stiff, plain = rig(Hidden.one("closed_cells", 0.5)), rig()
    assert stiff.stiffness == pytest.approx(1.5 * plain.stiffness, rel=1e-6)
