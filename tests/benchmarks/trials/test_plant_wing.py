"""The plant of the concealed trials: laws against closed forms, the whole wing against the product's simulator."""

import ast
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from scipy.signal import resample

import benchmarks.concealed.plant as plant
from benchmarks.concealed.plant.wing.banded import factor, solve
from benchmarks.concealed.plant.wing.geometry import Cut, counts_of
from benchmarks.concealed.plant.wing.integrator import A, C
from benchmarks.concealed.plant.wing.joints import joints, shares, torsion_constant
from benchmarks.concealed.plant.wing.linkage import angles, rocker, series_of
from benchmarks.concealed.plant.wing.periodic import Accuracy
from benchmarks.concealed.plant.wing.simulate import Beat, simulate
from benchmarks.concealed.plant.wing_effects.catalogue import KINDS, LISTED, UNKNOWN
from benchmarks.concealed.plant.wing_effects.hidden import Effect, Hidden, drawn
from wingfit.records import Condition, FourBarDrive
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, tunnel, vacuum
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.genes import lanes
from wingfit.sim.wing.structure import build

Array = npt.NDArray[np.float64]

WING = robird_wing()
MODEL = FlexibleWing(WING, "4")
NOMINAL = {gene.name: gene.nominal for gene in MODEL.genes}
THIN, THICK, STREAM = vacuum(10.0, 0.12, 4.0), vacuum(1000.0, 0.05, 3.0), tunnel(0.05, 3.5, 6.0)
# Where each effect of the air shows; all else shows in thin air.
IN_STREAM = (
    "dynamic_stall", "circulation_lag", "leading_edge_vortex", "added_mass", "jet", "closed_cells", "plate_drag",
    "rotational_circulation", "viscous_drag",
)  # fmt: skip
LEAST = {"rotational_circulation": 5e-5, "viscous_drag": 3e-6}  # m: these hardly move a wing of this size


def genome(seed: int) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    return {name: value * 1.6 ** rng.uniform(-1, 1) for name, value in NOMINAL.items()}


@cache
def beat(condition: Condition, name: str = "", strength: float = 0.0, division: str = "4") -> Beat:
    hidden = Hidden.one(name, strength) if name else Hidden()
    return simulate(WING, division, NOMINAL, condition, hidden)


def rms(difference: Array) -> float:
    return float(np.sqrt(np.mean(difference**2)))


def test_the_plant_shares_no_code_with_the_tool() -> None:
    for file in Path(plant.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            assert not [n for n in names if n.startswith("wingfit") and not n.startswith("wingfit.records")], file
            assert not [n for n in names if n.startswith("benchmarks") and "concealed.plant" not in n], file


# --- geometry -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("division", ["4", "11", "24", "8x1", "6x2", "3,1,2"])
def test_bodies_and_joints_are_those_of_the_simulator(division: str) -> None:
    """As near as the simulator's sums over cells are to the integrals."""
    structure, cut = build(WING, Division.parse(division)), Cut(WING, division)
    values = genome(3)
    group = lanes(structure, MODEL.genes, np.array([[values[gene.name] for gene in MODEL.genes]]))
    mass, centre, inertia = cut.bodies
    assert mass == pytest.approx([b.mass for b in structure.bodies], rel=3e-3)
    assert mass.sum() == pytest.approx(sum(b.mass for b in structure.bodies), rel=2e-4)
    assert np.abs(centre - [b.centre for b in structure.bodies]).max() < 1e-4
    assert np.abs(inertia - [b.inertia for b in structure.bodies]).max() < 3e-3 * np.abs(inertia).max()
    assert cut.area == pytest.approx([b.area for b in structure.bodies], rel=1e-3)
    found = {(j.first, j.second): j for j in joints(cut, values)}
    assert found.keys() == {(c.first, c.second) for c in structure.connectors}
    for k, connector in enumerate(structure.connectors):
        joint = found[connector.first, connector.second]
        assert joint.stiffness == pytest.approx(group.stiffness[k, :, 0], rel=2e-3)
        assert joint.damping == pytest.approx(group.damping[k, :, 0], rel=2e-3)
        assert joint.point == pytest.approx(connector.point, abs=1e-9)
    for prefix, share, place in (("L", group.lift_share, group.lift_x), ("ID", group.drag_share, group.drag_x)):
        assert shares(cut, values, prefix)[:, 0] == pytest.approx(share[:, 0], abs=1e-12)
        assert shares(cut, values, prefix)[:, 1] == pytest.approx(place[:, 0], abs=1e-4)
    places = np.array([m.position for m in WING.markers])
    assert (cut.under(places[:, 0], places[:, 1]) == structure.wiring.carrier).all()


def test_divisions_are_parsed_or_refused() -> None:
    assert counts_of("11") == (3, 3, 3, 2)
    assert counts_of("2x3") == (3, 3)
    for text in ("", "1x1", "4x0", "one", "3,-1"):
        with pytest.raises(ValueError, match="is invalid"):
            counts_of(text)


def test_torsion_of_a_square_and_of_a_strip() -> None:
    assert torsion_constant(1.0, 1.0) == pytest.approx(0.1406, abs=1e-4)  # Timoshenko and Goodier, section 109
    assert torsion_constant(0.01, 1e3) == pytest.approx(1e-6 / 3 * 1e3, rel=1e-4)


def test_a_linkage_closes_at_every_angle() -> None:
    link = WING.drive
    assert isinstance(link, FourBarDrive)
    psi = np.linspace(0.0, 2 * np.pi, 50)
    theta = rocker(link, psi) - link.offset
    tip = np.stack([link.ground + link.rocker * np.cos(theta), link.rocker * np.sin(theta)])
    pin = link.crank * np.stack([np.cos(psi), np.sin(psi)])
    assert np.linalg.norm(tip - pin, axis=0) == pytest.approx(np.full(50, link.coupler), rel=1e-12)
    assert angles(series_of(link), psi)[:, 0] == pytest.approx(rocker(link, psi), abs=1e-9)
    with pytest.raises(ValueError, match="shorten the crank"):
        rocker(replace(link, crank=0.05), psi)


# --- integrator -----------------------------------------------------------------------------------------------------


def test_the_method_has_order_four_and_second_stage_order() -> None:
    b = A[-1]
    sums = (b.sum(), b @ C, b @ C**2, b @ A @ C, b @ C**3, (b * C) @ A @ C, b @ A @ C**2, b @ A @ A @ C)
    assert sums == pytest.approx((1, 1 / 2, 1 / 3, 1 / 6, 1 / 4, 1 / 8, 1 / 12, 1 / 24), abs=1e-15)
    assert A.sum(axis=1) == pytest.approx(C, abs=1e-14)
    assert pytest.approx(C**2 / 2, abs=1e-14) == A @ C


def test_band_factors_solve() -> None:
    rng = np.random.default_rng(1)
    n, width = 18, 7
    full = rng.normal(size=(n, n))
    full = np.array([[full[max(i, j), min(i, j)] if abs(i - j) < width else 0.0 for j in range(n)] for i in range(n)])
    full += 20 * np.eye(n)
    band = np.array(
        [[full[i, i - width + 1 + k] if i - width + 1 + k >= 0 else 0.0 for k in range(width)] for i in range(n)]
    )
    right = rng.normal(size=n)
    x = right.copy()
    factor(band)
    solve(band, x)
    assert full @ x == pytest.approx(right, abs=1e-12)


def test_steps_are_fine_enough_and_the_motion_is_periodic() -> None:
    for condition in (THIN, STREAM):
        fine = simulate(WING, "4", NOMINAL, condition, None, Accuracy(96, 384, 1e-6)).tracks
        error = np.linalg.norm(resample(beat(condition).tracks, 384, axis=0) - fine, axis=2).max()
        assert error < 2e-5


@pytest.mark.parametrize(
    ("division", "condition", "allowed"),
    # what the simulator's sums over cells leave is most in thin air at 4 Hz: 0.05 mm, without them 0.008 mm
    [("4", THIN, 7e-5), ("4", STREAM, 2e-5), ("11", THICK, 4e-5), ("11", STREAM, 3e-5), ("24", THIN, 3e-5)],
)
def test_without_hidden_effects_the_motion_equals_the_simulators(
    division: str, condition: Condition, allowed: float
) -> None:
    values = genome(1)
    model = FlexibleWing(WING, division, numerics=Numerics(accuracy=1e-5))
    simulated = model.beat([values[gene.name] for gene in model.genes], blank_recording(WING, condition))
    found = simulate(WING, division, values, condition).tracks
    difference = found - resample(simulated.tracks, len(found), axis=0)
    assert np.linalg.norm(difference, axis=2).max() < allowed
    assert rms(difference) < 2e-5


# --- hidden effects as a whole --------------------------------------------------------------------------------------


def test_listed_effects_are_in_the_library_and_the_others_are_not() -> None:
    assert len(LISTED) >= 12
    assert len(UNKNOWN) >= 5
    assert set(LISTED) <= set(EFFECTS)
    assert not set(UNKNOWN) & set(EFFECTS)
    for name in LISTED:
        assert KINDS[name].family == EFFECTS[name].family


@pytest.mark.parametrize("name", list(KINDS))
def test_every_effect_vanishes_at_zero_strength_and_grows(name: str) -> None:
    condition, typical = STREAM if name in IN_STREAM else THIN, KINDS[name].typical
    nominal = beat(condition).tracks
    assert np.array_equal(beat(condition, name).tracks, nominal)
    sizes = [rms(beat(condition, name, part * typical).tracks - nominal) for part in (0.02, 0.3, 1.0)]
    assert sizes[0] < 0.4 * sizes[1]
    assert sizes[1] < 0.8 * sizes[2]
    assert LEAST.get(name, 4e-4) < sizes[2] < 1e-2


@pytest.mark.parametrize(
    ("name", "left"),
    [
        ("lumped_mass", 0.01), ("phase_lag_error", 0.01), ("hinge_tilt", 0.01), ("hinge_offset", 0.01),
        ("added_mass", 0.05), ("backlash", 0.05), ("stroke_amplitude", 0.3), ("drive_harmonics", 0.3),
    ],
)  # fmt: skip
def test_true_gene_values_mean_the_same_in_the_library(name: str, left: float) -> None:
    """The library's effect with these values moves the wing as the plant's does, but for the difference in form."""
    condition = STREAM if name in IN_STREAM else THIN
    found = beat(condition, name, KINDS[name].typical)
    base = FlexibleWing(WING, "4", numerics=Numerics(accuracy=1e-5))
    model = base.with_effects(name)
    blank, genes = blank_recording(WING, condition), found.truths[0].genes
    assert set(genes) <= {gene.name for gene in model.genes}
    with_it = model.beat([genes.get(gene.name, gene.nominal) for gene in model.genes], blank).tracks
    without = base.beat([gene.nominal for gene in base.genes], blank).tracks
    n = len(found.tracks)
    expected = resample(with_it, n, axis=0) - resample(without, n, axis=0)
    change = found.tracks - beat(condition).tracks
    assert rms(change - expected) < left * rms(change)


def test_two_effects_at_once_and_their_answers() -> None:
    both = Hidden((Effect("lumped_mass", 0.003, {"span": 0.6}), Effect("hinge_offset", 0.006)))
    found = simulate(WING, "4", NOMINAL, THIN, both)
    one = simulate(WING, "4", NOMINAL, THIN, Hidden(both.effects[:1])).tracks - beat(THIN).tracks
    other = beat(THIN, "hinge_offset", 0.006).tracks - beat(THIN).tracks
    assert rms(found.tracks - beat(THIN).tracks - one - other) < 0.1 * rms(one + other)
    assert [(t.name, t.span, t.listed) for t in found.truths] == [
        ("lumped_mass", 0.6, True), ("hinge_offset", None, True)
    ]  # fmt: skip


def test_a_stop_acts_where_the_wing_is_highest() -> None:
    found = beat(STREAM, "stop", KINDS["stop"].typical)
    (truth,) = found.truths
    assert truth.turn is not None
    change = np.abs(found.tracks - beat(STREAM).tracks).sum(axis=(1, 2))
    after = (2 * np.pi * np.argmax(change) / len(change) - truth.turn) % (2 * np.pi)
    assert after < 1.2  # rad: what it does to the wing is most soon after
    assert 0.1 < found.phase(truth.turn) < 0.5  # upstroke first: its end


def test_the_beat_begins_where_reference_markers_rise_through_the_hinge() -> None:
    found = beat(STREAM)
    columns = [[m.name for m in WING.markers].index(name) for name in WING.reference_markers]
    height = resample(found.tracks[:, columns, 2].mean(axis=1), 4096)
    k = round(found.crossing / (2 * np.pi) * 4096)
    assert abs(height[k % 4096]) < 1e-4
    assert height[(k + 20) % 4096] > 1e-3


def test_draws_stay_in_their_ranges_and_unknown_effects_are_refused() -> None:
    rng = np.random.default_rng(5)
    for name, kind in KINDS.items():
        effect = drawn(name, kind.typical, rng)
        for key, (_, low, high) in kind.shape.items():
            assert low <= effect.values[key] <= high
    with pytest.raises(ValueError, match="cannot hide 'ghost'"):
        simulate(WING, "4", NOMINAL, THIN, Hidden.one("ghost", 1.0))
    with pytest.raises(ValueError, match="no parameter 'colour'"):
        simulate(WING, "4", NOMINAL, THIN, Hidden.one("stop", 1.0, colour=2.0))
