"""Laws that the plant of the flexible wing hides, against the effects of the library that have the same name."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from scipy.signal import resample
from scipy.spatial.transform import Rotation

from benchmarks.concealed.plant.wing.air_loads import air_loads
from benchmarks.concealed.plant.wing.build import Draft, rig_of
from benchmarks.concealed.plant.wing.geometry import Cut
from benchmarks.concealed.plant.wing.motor import lead
from benchmarks.concealed.plant.wing.point_loads import point_loads
from benchmarks.concealed.plant.wing.rig import Motion, Rig
from benchmarks.concealed.plant.wing.simulate import Beat, simulate
from benchmarks.concealed.plant.wing_effects.catalogue import KINDS
from benchmarks.concealed.plant.wing_effects.hidden import Hidden
from wingfit.records import Condition
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, tunnel, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing

Array = npt.NDArray[np.float64]

WING = robird_wing()
MODEL = FlexibleWing(WING, "4", numerics=Numerics(accuracy=1e-5))
NOMINAL = {gene.name: gene.nominal for gene in MODEL.genes}
CHORDS = np.array([(one.y, one.chord) for one in WING.stations]).T
MEAN_CHORD = float(np.trapezoid(CHORDS[1], CHORDS[0]) / np.ptp(CHORDS[0]))
THIN, STREAM = vacuum(10.0, 0.12, 4.0), tunnel(0.05, 3.5, 6.0)
# Genes of the library's effects whose meaning differs from the law's, at the values that come nearest.
NEAREST: dict[str, Callable[[float, Mapping[str, float]], dict[str, float]]] = {
    "rotational_circulation": lambda s, _: {"coefficient": s * NOMINAL["L_a"]},
    "viscous_drag": lambda s, _: {"part": 1.7 * s},  # turbulent over laminar friction at a Reynolds number of 1e5
    "tether": lambda s, at: {"k": 0.75 * s, "c": s * at["time"]},  # the cord softens
    "cable": lambda s, at: {"k": s, "c": s * at["time"]},
    "compliant_drive": lambda s, _: {"d": s},
    "mass_offset": lambda s, _: {"distance": s * MEAN_CHORD},
}
# The least change in mm that a typical strength must cause: friction and pitch rates hardly move a wing of this size.
LEAST = {"rotational_circulation": 0.05, "viscous_drag": 0.003}
NEW = (
    ("residual_air", STREAM), ("stroke_bias", THIN), ("mass_offset", THIN), ("rotational_circulation", STREAM),
    ("plate_drag", STREAM), ("viscous_drag", STREAM), ("tether", THIN), ("cable", THIN),
    ("compliant_drive", STREAM),
)  # fmt: skip


@cache
def beat(condition: Condition, name: str = "", strength: float = 0.0) -> Beat:
    return simulate(WING, "4", NOMINAL, condition, Hidden.one(name, strength) if name else Hidden())


@cache
def library_beat(condition: Condition, name: str = "", *genes: tuple[str, float]) -> Array:
    model = MODEL.with_effects(name) if name else MODEL
    values = dict(genes)
    assert set(values) <= {gene.name for gene in model.genes}
    genome = [values.get(gene.name, gene.nominal) for gene in model.genes]
    return np.asarray(model.beat(genome, blank_recording(WING, condition)).tracks)


def size(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize(("name", "condition"), NEW)
def test_a_law_is_absent_at_zero_strength_and_has_the_sign_of_its_gene(name: str, condition: Condition) -> None:
    kind, nominal = KINDS[name], beat(condition).tracks
    assert np.array_equal(beat(condition, name, 0.0).tracks, nominal)
    found = beat(condition, name, kind.typical)
    (truth,) = found.truths
    nearest = NEAREST[name](kind.typical, truth.parameters) if name in NEAREST else {}
    genes = {**truth.genes, **{f"{name}.{key}": value for key, value in nearest.items()}}
    theirs = library_beat(condition, name, *genes.items()) - library_beat(condition)
    ours = found.tracks - nominal
    theirs = np.asarray(resample(theirs, len(ours), axis=0))
    assert (ours * theirs).sum() > 0.95 * math.sqrt((ours**2).sum() * (theirs**2).sum())
    assert 0.7 < size(ours) / size(theirs) < 1.3
    assert 1e3 * size(ours) > LEAST.get(name, 0.4)


def rig(hidden: Hidden, condition: Condition = STREAM, **changes: object) -> Rig:
    draft = Draft(WING, "4", NOMINAL, condition)
    hidden.put_into(draft)
    return rig_of(draft)._replace(**changes)  # type: ignore[arg-type]


def still(one: Rig) -> Motion:
    n = len(one.mass)
    zero = np.zeros((n + 2, 3))
    places = np.concatenate([one.rest, [one.hinge, one.hinge]])
    return Motion(np.tile(np.eye(3), (n + 2, 1, 1)), places, zero.copy(), zero.copy(), zero.copy(), zero.copy())


def in_air(one: Rig, velocity: Array, turning: Array) -> Array:
    """Loads [6, 6] on a wing whose bodies all move with a velocity and turn about their own centroids."""
    motion, load = still(one), np.zeros((6, 6))
    motion.w[:] = turning
    arms = np.pad(one.centroid, ((0, 2), (0, 1)))
    motion.v[:] = velocity - np.cross(motion.w, arms)
    air_loads(one, motion, np.zeros(0), 1e-3, np.zeros(0), 0, load)
    return load


def test_a_plate_is_pushed_along_its_normal_and_rubbed_along_its_chord() -> None:
    bare, none = np.zeros(4), np.zeros(3)
    one = rig(Hidden.one("plate_drag", 0.8), coefficients=bare, wind=np.array([6.0, 0.0, 0.0]))
    load = in_air(one, np.array([0.0, 0.0, -2.0]), none)
    assert load[:4, 2] == pytest.approx(0.5 * one.air * one.area * 0.8 * 4.0, rel=1e-9)
    assert np.abs(load[:, 0]).max() < 1e-12
    one = rig(Hidden.one("viscous_drag", 1.0), coefficients=bare, wind=np.array([6.0, 0.0, 0.0]))
    load = in_air(one, none, none)
    reynolds = 6.0 * one.chord / 1.51e-5
    friction = 0.5 * one.air * 36.0 * one.area * 2 * 0.074 * reynolds**-0.2
    assert load[:4, 0] == pytest.approx(friction, rel=0.01)


def test_lift_of_a_pitching_wing_is_that_at_three_quarters_of_its_chord() -> None:
    lifting, wind = np.array([4.0, 0.0, 0.0, 0.0]), np.array([6.0, 0.0, 0.0])
    one = rig(Hidden.one("rotational_circulation", 1.0), coefficients=lifting, wind=wind)
    nose_up = in_air(one, np.zeros(3), np.array([0.0, 2.0, 0.0]))
    alpha = np.arctan2(2.0 * 0.25 * one.chord, 6.0)
    assert nose_up[:4, 2] == pytest.approx(0.5 * one.air * 36.0 * one.area * 4.0 * alpha, rel=1e-6)


def test_a_cord_pulls_back_and_softens() -> None:
    one = rig(Hidden.one("tether", 2.0, time=0.01))
    pulls = []
    for lift in (1e-4, 0.1):
        motion, load, z = still(one), np.zeros((6, 6)), np.zeros(2)
        motion.p[:, 2] += lift
        point_loads(one, motion, z.copy(), 1e-9, z, 0, load)
        pulls.append(load[one.point_body[0], 2])
    assert pulls[0] == pytest.approx(-2.0 * 1e-4, rel=1e-3)
    ratio = 1.0 + 0.1 / one.points[0, 5]
    assert pulls[1] == pytest.approx(-2.0 * one.points[0, 5] / 3 * (ratio - ratio**-2), rel=1e-9)
    motion, load, z = still(one), np.zeros((6, 6)), np.zeros(2)
    motion.v[:, 1] = 3.0
    point_loads(one, motion, z.copy(), 1e-9, z, 0, load)
    assert load[one.point_body[0], 1] == pytest.approx(-2.0 * 0.01 * 3.0)


def clamped(one: Rig, turn: Rotation, turning: Array | None = None) -> Array:
    """Moment [3] on the wing of all cables, where all bodies are turned alike and turn with an angular velocity."""
    motion, load, z = still(one), np.zeros((6, 6)), np.zeros(2 * len(one.points))
    motion.R[:] = turn.as_matrix()
    motion.w[:] = 0.0 if turning is None else turning
    point_loads(one, motion, z.copy(), 1e-9, z, 0, load)
    assert not load[:, :3].any(), "a moment alone"
    return np.asarray(load[:, 3:].sum(axis=0))


def test_a_cable_resists_bending_in_proportion_to_the_angle_and_torsion_less() -> None:
    one = rig(Hidden.one("cable", 2.0, time=0.01, span=0.45))
    assert one.points[:, 4].sum() == pytest.approx(2.0)
    centre = (one.rest[one.point_body, 1] - WING.stations[0].y) / WING.span
    assert abs(centre @ one.points[:, 4] / 2.0 - 0.45) < 0.02  # centres of mass are near the middles of strips
    for angle in (1e-3, -0.8, 1.4):
        assert clamped(one, Rotation.from_rotvec([angle, 0, 0])) == pytest.approx([-2.0 * angle, 0, 0], abs=1e-12)
        assert clamped(one, Rotation.from_rotvec([0, 0, angle])) == pytest.approx([0, 0, -2.0 * angle], abs=1e-12)
        torsion = -2.0 / 5.6 * angle  # G J / L over 4 E I / L of a round cable with Poisson's ratio 0.4
        assert clamped(one, Rotation.from_rotvec([0, angle, 0])) == pytest.approx([0, torsion, 0], abs=1e-12)
    nothing = Rotation.identity()
    assert clamped(one, nothing, np.array([1.0, -2.0, 3.0])) == pytest.approx([-0.02, 0.04, -0.06])


def test_a_cable_gives_back_the_energy_of_its_bending_and_torsion() -> None:
    """Its moment is minus the derivative of (k b^2 + K c^2) / 2 by a rotation, and no energy is won on a round trip."""
    one, rng = rig(Hidden.one("cable", 2.0)), np.random.default_rng(4)

    def energy(turn: Rotation) -> float:
        x, y, z, s = (float(one) for one in turn.as_quat())  # the last is the scalar part
        bent = 2 * math.atan2(math.hypot(x, z), math.hypot(y, s))
        return bent**2 + (2 * math.atan(y / s)) ** 2 / 5.6

    for turn in Rotation.from_rotvec(rng.uniform(-1.0, 1.0, (8, 3))):
        slopes = [
            (energy(Rotation.from_rotvec(unit) * turn) - energy(Rotation.from_rotvec(-unit) * turn)) / 2e-5
            for unit in 1e-5 * np.eye(3)
        ]
        assert clamped(one, turn) == pytest.approx(-np.array(slopes), abs=1e-7)


def test_mass_moves_aft_with_the_chord_and_air_is_added() -> None:
    plain, moved = Cut(WING, "4"), Cut(WING, "4", aft=0.01)
    shift = moved.bodies[1] - plain.bodies[1]
    chord = plain.area / np.diff(plain.edges)
    assert shift[:, 0] == pytest.approx(0.01 * chord * (plain.edges[-1] - plain.edges[0]) / plain.area.sum())
    assert not shift[:, 1:].any()
    np.testing.assert_array_equal(moved.bodies[2], plain.bodies[2])
    assert rig(Hidden.one("residual_air", 0.08), THIN).air == pytest.approx(rig(Hidden(), THIN).air + 0.08, rel=1e-3)


def test_the_motor_is_slow_where_the_load_is_heavy() -> None:
    """For a load of one harmonic the lead solves t s' + s = -d P - g tau with tau' = s."""
    draft = Draft(WING, "4", NOMINAL, THIN)
    draft.motor = (0.005, 0.04)
    psi, omega = 2 * np.pi * np.arange(96) / 96, 2 * np.pi * THIN.flap_frequency
    found = lead(7.0 + 3.0 * np.cos(2 * psi), draft)
    assert found[0] == 0.0
    tau, speed = found[2] / omega, 2j * omega * found[2] / omega
    assert 2j * omega * 0.04 * speed + speed == pytest.approx(-0.005 * 3.0 - 2.0 * omega * tau)
    assert np.abs(np.delete(found, 2)).max() < 1e-12
