"""The air's kernel against a plain version of thesis Eqs. 8-13 written from the text, and against hand arithmetic."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from tests.oracles.plates import cut, loaded, plate, straight_rod
from tests.oracles.strip_air import Blown, body_loads, strip_air
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.air import strip_flow, strip_forces
from wingfit.sim.kernels.arrays import AREA, FLOW, GEOMETRY, LOADS

Array = npt.NDArray[np.float64]

DENSITY = 1.2


class Loads(NamedTuple):
    """What it answers."""

    wrench: Array
    damping: Array
    power: Array
    force: Array


def blow(case: Blown) -> Loads:
    n = len(case.weight)
    out = Loads(np.zeros((n, 6, LANES)), np.zeros((n, LANES)), np.zeros(LANES), np.zeros((3, LANES)))
    add_air(case, out)
    return out


def add_air(case: Blown, out: Loads) -> None:
    """Both kernels one after the other, as the integrator calls them without effects."""
    strips = len(case.area)
    flow, loads = np.zeros((strips, FLOW, LANES)), np.zeros((strips, LOADS, LANES))
    geometry, places, none = np.zeros((strips, GEOMETRY)), np.zeros((len(case.V), 3, LANES)), np.zeros((0, 3, LANES))
    geometry[:, AREA] = case.area
    density, wind = np.full(LANES, case.density), np.repeat(case.wind[:, None], LANES, axis=1)
    strip_flow(
        case.start, case.weight, case.centroid, wind, case.coefficients, none, case.R, places, case.V, flow, loads
    )
    strip_forces(
        case.start, case.weight, case.centroid, geometry, density, case.lift_share, case.lift_x, case.drag_share,
        case.drag_x, flow, loads, False, case.R, case.V, *out,
    )  # fmt: skip


def tumbling(seed: int, wind: tuple[float, float, float], speed: float) -> Blown:
    """Strips of 3, 1 and 2 bodies, every lane with its own pose, motion, coefficients and shares."""
    rng = np.random.default_rng(seed)
    counts = np.array([3, 1, 2])
    start, n = np.concatenate([[0], np.cumsum(counts)]), int(counts.sum())
    strip = np.repeat(np.arange(3), counts)

    def shares(rows: int) -> Array:
        raw = rng.uniform(0.2, 1.0, (rows, LANES))
        return np.asarray(raw / np.add.reduceat(raw, start[:-1])[strip])

    R = Rotation.from_rotvec(0.25 * rng.normal(size=(n * LANES, 3))).as_matrix().reshape(n, LANES, 9)
    return Blown(
        start=start,
        weight=shares(n)[:, 0].copy(),
        centroid=rng.uniform(-0.01, 0.01, (n, 2)),
        area=rng.uniform(0.01, 0.02, 3),
        density=DENSITY,
        wind=np.array(wind),
        coefficients=rng.uniform(0.5, 1.5, (4, LANES)) * np.array([4.0, 0.3, 0.8, 0.1])[:, None],
        lift_share=shares(n),
        lift_x=rng.uniform(-0.05, 0.05, (n, LANES)),
        drag_share=shares(n),
        drag_x=rng.uniform(-0.05, 0.05, (n, LANES)),
        R=np.ascontiguousarray(np.swapaxes(R, 1, 2)),
        V=rng.normal(size=(n, 6, LANES)) * speed,
    )


FLOWS = {
    "forward": ((9.0, 0.5, 0.8), 0.5),
    "from below": ((0.1, 0.0, 7.0), 0.5),
    "from above": ((-0.2, 1.0, -7.0), 0.5),
    "from behind": ((-8.0, 0.0, 1.5), 0.5),
    "still air": ((0.0, 0.0, 0.0), 3.0),
}


@pytest.mark.parametrize("flow", FLOWS)
@pytest.mark.parametrize("seed", [1, 2])
def test_kernel_is_the_plain_version(flow: str, seed: int) -> None:
    case = tumbling(seed, *FLOWS[flow])
    loads, (wrench, force) = blow(case), body_loads(case)
    np.testing.assert_allclose(loads.wrench, wrench, rtol=1e-7, atol=1e-9 * np.abs(wrench).max())
    np.testing.assert_allclose(loads.force, force, rtol=1e-7, atol=1e-9 * np.abs(force).max())


@pytest.mark.parametrize("flow", FLOWS)
def test_power_is_wrench_times_twist_and_force_is_the_bodies_sum(flow: str) -> None:
    case = tumbling(3, *FLOWS[flow])
    loads = blow(case)
    np.testing.assert_allclose(loads.power, (loads.wrench * case.V).sum(axis=(0, 1)), rtol=1e-9)
    R = case.R.reshape(-1, 3, 3, LANES)
    np.testing.assert_allclose(loads.force, np.einsum("nijw,njw->iw", R, loads.wrench[:, 3:]), rtol=1e-7, atol=1e-12)


def test_wrench_is_added_to_what_is_there() -> None:
    case = tumbling(4, *FLOWS["forward"])
    alone = blow(case).wrench
    out = Loads(np.full_like(alone, 2.0), np.zeros(alone[:, 0].shape), np.zeros(LANES), np.zeros((3, LANES)))
    add_air(case, out)
    np.testing.assert_allclose(out.wrench, alone + 2.0, rtol=1e-12)


def flat(wind: Array) -> Blown:
    """One level body of 0.06 m^2 at rest in the wind, lift and drag at its centroid."""
    ones = np.ones((1, LANES))
    level = np.repeat(np.eye(3).reshape(1, 9, 1), LANES, axis=2)
    return Blown(
        np.array([0, 1]), np.ones(1), np.zeros((1, 2)), np.array([0.06]), DENSITY, wind,
        np.repeat(np.array([[4.0], [0.3], [0.8], [0.1]]), LANES, axis=1), ones, 0 * ones, ones, 0 * ones, level,
        np.zeros((1, 6, LANES)),
    )  # fmt: skip


@pytest.mark.parametrize("degrees", [-74.0, -40.0, -3.0, 0.0, 5.0, 15.0, 74.0])
def test_affine_law_to_the_letter(degrees: float) -> None:
    """F = 1/2 rho v^2 S C, lift square to the flow and drag along it, for flow at alpha from below a level chord."""
    alpha, v = np.radians(degrees), 7.0
    wind = v * np.array([np.cos(alpha), 0.0, np.sin(alpha)])
    lift, drag = 4.0 * alpha + 0.3, 0.8 * abs(alpha) + 0.1
    along, square = wind / v, np.array([-np.sin(alpha), 0.0, np.cos(alpha)])
    expected = 0.5 * DENSITY * v**2 * 0.06 * (lift * square + drag * along)
    np.testing.assert_allclose(blow(flat(wind=wind)).force[:, 0], expected, rtol=1e-9, atol=1e-12)


def test_from_behind_the_lift_keeps_the_side_of_the_flow() -> None:
    """Flow from behind and below is the mirror image of flow from ahead and below."""
    ahead, behind = (blow(flat(wind=np.array([x, 0.0, 1.5]))).force[:, 0] for x in (6.0, -6.0))
    np.testing.assert_allclose(behind, ahead * [-1, 1, 1], rtol=1e-9, atol=1e-12)


def test_force_has_no_jump_where_the_flow_turns() -> None:
    degrees = np.linspace(80.0, 100.0, 2001)
    force = np.array(
        [blow(flat(wind=5.0 * np.array([np.cos(a), 0.0, np.sin(a)]))).force[:, 0] for a in np.radians(degrees)]
    )
    assert np.abs(np.diff(force, axis=0)).max() < 0.005 * np.linalg.norm(force, axis=1).max()


@pytest.mark.parametrize("flow", FLOWS)
def test_lift_does_no_work_on_the_flow_and_drag_lies_along_it(flow: str) -> None:
    one = tumbling(5, *FLOWS[flow])
    for kept, lifting in (((0, 1), True), ((2, 3), False)):
        coefficients = np.zeros_like(one.coefficients)
        coefficients[list(kept)] = one.coefficients[list(kept)]
        area = np.array([0.02, 0.0, 0.0])  # the first strip alone
        case = one._replace(coefficients=coefficients, area=area)
        force = blow(case).force
        for w in range(LANES):
            chord, normal, air = strip_air(case, 0, w)
            air = (air @ chord) * chord + (air @ normal) * normal
            size = float(np.linalg.norm(force[:, w]) * np.linalg.norm(air))
            assert force[:, w] @ air == pytest.approx(0.0 if lifting else size, abs=1e-8 * size)


def test_normal_damping_is_the_slope_of_the_force() -> None:
    """What the linearisation takes: how the normal force falls with normal speed, at alpha = 0, drag without slope."""
    case = flat(wind=np.array([6.0, 0.0, 0.0]))
    case.coefficients[2] = 0.0
    h, pushed = 1e-5, []
    for speed in (-h, h):
        V = np.zeros((1, 6, LANES))
        V[0, 5] = speed
        pushed.append(blow(case._replace(V=V)).wrench[0, 5, 0])
    assert blow(case).damping[0, 0] == pytest.approx((pushed[0] - pushed[1]) / (2 * h), rel=1e-6)


def quartered(division: str, quarters: tuple[float, ...], drags: tuple[float, ...]) -> tuple[Array, ...]:
    """Shares and places (from the leading edge, m) of lift and drag on the bodies of the first strip, chord 0.4 m."""
    rods = (straight_rod("front", 0.1, 1.0, 0.0), straight_rod("rear", 0.2, 1.0, 0.0))
    structure = cut(plate(0.4, 1.0, 0.01, rods), division)
    genome = {f"L_{k}": x for k, x in enumerate(quarters, 1)} | {f"ID_{k}": x for k, x in enumerate(drags, 1)}
    group, n = loaded(structure, genome), structure.division.bodies[0]
    x = np.array([body.centre[0] for body in structure.bodies[:n]])
    lift, drag = group.lift_share[:n, 0], group.drag_share[:n, 0]
    return lift, group.lift_x[:n, 0] + x, drag, group.drag_x[:n, 0] + x


def test_quarters_count_from_the_leading_edge() -> None:
    """Weights over their sum on the four bodies, each at its own middle; halves and thirds take what they cover."""
    L, D = (0.8, 0.6, 0.4, 0.2), (0.3, 0.6, 0.6, 1.5)
    lift, lift_x, drag, drag_x = quartered("2x4", L, D)
    np.testing.assert_allclose(lift, [0.4, 0.3, 0.2, 0.1])
    np.testing.assert_allclose(drag, [0.1, 0.2, 0.2, 0.5])
    np.testing.assert_allclose([lift_x, drag_x], [[0.05, 0.15, 0.25, 0.35]] * 2)
    lift, lift_x, drag, drag_x = quartered("2x2", L, D)
    np.testing.assert_allclose(lift, [0.7, 0.3])
    np.testing.assert_allclose(lift_x, [(0.4 * 0.05 + 0.3 * 0.15) / 0.7, (0.2 * 0.25 + 0.1 * 0.35) / 0.3])
    np.testing.assert_allclose(drag_x, [(0.1 * 0.05 + 0.2 * 0.15) / 0.3, (0.2 * 0.25 + 0.5 * 0.35) / 0.7])
    lift, lift_x, _, _ = quartered("2x3", L, D)
    np.testing.assert_allclose(lift, [0.5, 1 / 3, 1 / 6])
    # first third: all of quarter 1 (0 to 0.1 m) and a third of quarter 2 (0.1 to 0.1333 m)
    assert lift_x[0] == pytest.approx((0.4 * 0.05 + 0.1 * (0.1 + 0.1 / 6)) / 0.5)
    lift, lift_x, drag, drag_x = quartered("2x1", L, D)
    np.testing.assert_allclose([lift, drag], 1.0)
    np.testing.assert_allclose([lift_x[0], drag_x[0]], [0.15, 0.26])


@pytest.mark.parametrize("division", ["2x1", "2x2", "2x4"])
@pytest.mark.parametrize(("quarters", "nose"), [((8.0, 1.0, 1.0, 1.0), 1), ((1.0, 1.0, 1.0, 8.0), -1)])
def test_load_ahead_of_the_middle_lifts_the_nose(division: str, quarters: tuple[float, ...], nose: int) -> None:
    """Moment of the air about the middle of the chord, about y (outboard): positive raises the leading edge."""
    rods = (straight_rod("front", 0.1, 1.0, 0.0), straight_rod("rear", 0.2, 1.0, 0.0))
    structure = cut(plate(0.4, 1.0, 0.01, rods), division)
    group = loaded(structure, {f"L_{k}": x for k, x in enumerate(quarters, 1)} | {"ID_a": 1e-9, "ID_b": 1e-9})
    w, n = structure.wiring, len(structure.bodies)
    level = np.repeat(np.tile(np.eye(3).reshape(1, 9, 1), (n, 1, 1)), LANES, axis=2)
    case = Blown(
        w.strip_start, w.weight, w.centroid, w.geometry[:, AREA], DENSITY, np.array([6.0, 0.0, 0.5]),
        group.coefficients, group.lift_share, group.lift_x, group.drag_share, group.drag_x, level,
        np.zeros((n, 6, LANES)),
    )  # fmt: skip
    wrench = blow(case).wrench[..., 0]
    arms = np.array([body.centre for body in structure.bodies]) - [0.2, 0.0, 0.0]
    about_middle = (wrench[:, :3] + np.cross(arms, wrench[:, 3:])).sum(axis=0)
    lever = 0.4 * (3 / 8 - np.dot(quarters, [0, 0.25, 0.5, 0.75]) / 11)  # ahead of the middle
    assert np.sign(lever) == nose
    assert wrench[:, 5].sum() > 0
    assert about_middle[1] == pytest.approx(wrench[:, 5].sum() * lever, rel=1e-6)
