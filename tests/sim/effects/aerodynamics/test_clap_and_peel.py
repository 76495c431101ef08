"""Two plates that open, by potential flow; and what a strip near a mirror plane makes of it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from tests.oracles.plates import loaded
from tests.sim.effects.moved import Motion, Moved
from tests.sim.effects.rigs import bare, force_recording, rig_of, vehicle_model
from tests.sim.kernels.marching import CHORD, LENGTH, plank
from wingfit.records import Condition, FourierDrive, Hinge
from wingfit.sim.effects.library.aerodynamics.clap_and_peel import EFFECT, fling_near
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import CHORD_X, CIRCULATION, NORMAL_X, STREAM_C, STREAM_N
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.structure import build

Array = npt.NDArray[np.float64]

PLAIN = {"L_a": 4.0, "L_b": 0.0}


def potential_fling(angle: float, gap: float, panels: int = 80) -> float:
    """Circulation (in omega c^2) of a plate that turns away from a wall about its trailing edge, smooth flow there.

    Vortices at a quarter of each panel with their images, no flow through the plate at three quarters: the other plate
    is the image, ``angle`` (rad) is to the wall and ``gap`` between both trailing edges, in chords.
    """
    along = np.exp(1j * angle)
    at = (np.arange(panels)[:, None] + [0.25, 0.75]) / panels  # from the leading edge
    vortex, point = (0.5j * gap + (1 - at.T) * along)[:, None, :]
    velocity = 1 / (2j * np.pi * (point.T - vortex)) - 1 / (2j * np.pi * (point.T - vortex.conj()))
    strength = np.linalg.solve((velocity * 1j * along).real, 1 - at[:, 1])
    return -float(strength.sum())


def by_law(angle: float, gap: float, coefficient: float = 2.7) -> float:
    """The law in its own words, in omega c^2."""
    distance = 0.5 * gap + 0.5 * np.sin(angle)
    return float(0.5 * coefficient * fling_near(distance) * np.clip(1 - np.sqrt(2) * np.sin(angle), 0, 1))


def test_the_oracle_is_that_of_lighthill() -> None:
    """0.69 omega c^2 where the wings part, at 120 degrees between them (Lighthill 1973); pi / 4 of a single wing."""
    assert potential_fling(np.radians(60.0), 1e-6) == pytest.approx(0.69, abs=0.005)
    assert potential_fling(0.3, 1e5) == pytest.approx(np.pi / 4, rel=1e-3)
    narrow = np.radians(0.5)
    assert potential_fling(narrow, 1e-6, 300) - np.pi / 4 == pytest.approx(1 / (4 * narrow), rel=0.08)


@pytest.mark.parametrize("gap", [0.0, 0.1, 0.3, 0.5, 1.0, 2.0])
def test_the_law_is_what_potential_flow_adds_to_a_single_wing(gap: float) -> None:
    """Within 0.15 omega c^2 once mid-chord is 0.15 chords off; nearer, where that has no bound, it stays finite."""
    for angle in np.radians([1.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0]):
        more = potential_fling(angle, gap + 1e-6) - np.pi / 4
        if 0.5 * gap + 0.5 * np.sin(angle) > 0.15:
            assert by_law(angle, gap) == pytest.approx(more, abs=0.15)
        else:
            assert by_law(angle, gap) < 1.35 * 1.01


def added(motion: Motion, clearance: npt.ArrayLike, airspeed: float = 0.0, strips: int = 2) -> tuple[Moved, Array]:
    """Circulation [S, W] (as speed times lift coefficient) that the effect adds to a plank; its drive stays at 0."""
    values = {"coefficient": 2.7, "clearance": clearance}
    moved = Moved("clap_and_peel", values, airspeed=airspeed, strips=strips, genes=PLAIN)
    moved.rate(motion, moved.z)
    without = Moved("clap_and_peel", values | {"coefficient": 0.0}, airspeed=airspeed, strips=strips, genes=PLAIN)
    without.rate(motion, without.z)
    return moved, moved.work.loads[:, CIRCULATION] - without.work.loads[:, CIRCULATION]


def test_a_strip_near_the_plane_flings_by_the_law() -> None:
    """Gap and angle are those to a plane that is turned about the flapping axis by the clearance."""
    opened, rate = np.linspace(-0.2, 0.5, LANES), 7.0
    _, found = added(Motion(flap=-0.1, pitch=-opened, pitch_rate=-rate), 0.15, strips=4)
    for s, y in enumerate(LENGTH * (np.arange(4) + 0.5) / 4):
        for lane, angle in enumerate(opened):
            # the wing turns about its leading edge, which lies on the flapping axis
            middle = np.array([y * np.cos(0.1), y * np.sin(-0.1)]) + 0.5 * CHORD * np.sin(angle) * np.array(
                [-np.sin(-0.1), np.cos(0.1)]
            )
            normal = np.array([-np.sin(0.15), np.cos(0.15)])
            sine = np.sin(angle) * np.cos(0.25)
            gap = 2 * (-(middle @ normal) / CHORD - 0.5 * sine)
            expected = by_law(np.arcsin(sine), gap) * rate * CHORD**2
            assert 0.5 * CHORD * found[s, lane] == pytest.approx(expected, rel=1e-9), (s, angle)


def test_only_opening_wings_fling_and_only_when_near() -> None:
    _, closing = added(Motion(pitch=-0.1, pitch_rate=3.0), 0.02)
    assert np.all(closing == 0.0)
    _, parted = added(Motion(pitch=-0.1, flap_rate=-5.0), 0.02)
    assert np.all(parted == 0.0), "two plates that part side by side are fed from both edges alike"
    _, near = added(Motion(pitch=-0.1, pitch_rate=-3.0), 0.02)
    _, far = added(Motion(flap=-0.7, pitch=-0.1, pitch_rate=-3.0), 0.02)
    assert np.all(near > 0)
    assert np.all(far[1] < 0.01 * near[1])
    _, through = added(Motion(flap=0.2, pitch_rate=-3.0), 0.0)
    np.testing.assert_allclose(through, 2.7 * CHORD * 3.0, rtol=1e-9)


def test_it_pulls_ahead_and_up_on_the_way_down() -> None:
    """Gamma v across the stream: forward of a wing that leaves the plane, up of one in a stream from ahead."""
    for motion, airspeed, axis, sign in (
        (Motion(pitch=-0.1, pitch_rate=-3.0, heave_rate=-1.0), 0.0, 0, -1),
        (Motion(pitch=-0.1, pitch_rate=-3.0), 5.0, 2, 1),
    ):
        moved, more = added(motion, 0.02, airspeed)
        flow = moved.work.flow
        force = more * (flow[:, STREAM_C] * flow[:, NORMAL_X + axis] - flow[:, STREAM_N] * flow[:, CHORD_X + axis])
        assert np.all(sign * force > 0)


def test_the_plane_holds_the_hinge_above_the_top_of_the_stroke() -> None:
    """Of a wing that turns about another place, and whose drive swings from -0.3 to 0.5."""
    wing = plank(FourierDrive(0.1, (0.4,), ()), Hinge(-0.02, 0.01))
    motion = Motion(flap=0.4, pitch_rate=-3.0)
    both = [Moved("clap_and_peel", {"coefficient": c}, wing=wing, genes=PLAIN) for c in (2.7, 0.0)]
    for one in both:
        one.rate(motion, one.z)
    more = both[0].work.loads[:, CIRCULATION] - both[1].work.loads[:, CIRCULATION]
    y = LENGTH * np.array([0.25, 0.75])
    below = (y * np.cos(0.4) + 0.02) * np.sin(0.5) - (y * np.sin(0.4) - 0.01) * np.cos(0.5)
    assert np.all(below > 0)
    expected = 2.7 * CHORD * 3.0 * fling_near(below / CHORD)
    np.testing.assert_allclose(more, np.repeat(expected[:, None], LANES, axis=1), rtol=1e-6)


def test_the_plane_stands_over_the_mean_of_both_rods() -> None:
    """Two rods that swing by a about 0.1, the rear one late by phi: their mean swings by a cos(phi / 2)."""
    lag, wing = 0.8, plank(FourierDrive(0.1, (0.4,), ()))
    structure = build(wing, Division.parse("2x1"))
    scene = WingScene.of(structure, Condition(3.0, lag, 101325.0, 293.15), loaded(structure, {}))
    assert EFFECT.wing
    EFFECT.wing(scene, {"coefficient": np.full(LANES, 2.7), "clearance": np.full(LANES, 0.05)})
    _, sine, cosine, _ = scene.frozen().laws.parameters.reshape(4, 2, LANES)
    np.testing.assert_allclose(np.arctan2(sine, cosine), 0.1 + 0.4 * np.cos(lag / 2) + 0.05, atol=2e-5)


def test_a_vehicles_fling_is_that_of_the_term() -> None:
    """C_F + C_R of Eq. 7 while the wings peel, and no clearance, which would only multiply it."""
    whole, model = vehicle_model(), bare("vehicle", "clap_and_peel").with_effects("clap_and_peel")
    assert [gene.name for gene in EFFECT.genes(rig_of(model))] == ["clap_and_peel.coefficient"]
    values = {gene.name: gene.nominal for gene in whole.genes}
    fling = values.pop("C_F") + 0.75 * values["C_r"]
    expected = whole.observe(np.array([[g.nominal for g in whole.genes]]), force_recording()).channels
    found = model.observe(np.array([[*values.values(), fling]]), force_recording()).channels
    np.testing.assert_allclose(found, expected, atol=1e-9)
