"""The force of a separated flow: square to the wing, as measured, and only beyond attached flow."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from tests.sim.effects.moved import Motion, Moved
from wingfit.sim.kernels.arrays import CIRCULATION, DRAG, DRAG_SLOPE, LIFT_SLOPE, SPEED, STREAM_C, STREAM_N

Array = npt.NDArray[np.float64]

WIND = 6.0
WHOLE = {"part": 1.0, "angle": 0.0, "coefficient": 1.58}
STEEP = np.radians([-80.0, -45.0, -15.0, 12.0, 30.0, 45.0, 60.0, 85.0])


def coefficients(moved: Moved) -> tuple[Array, Array]:
    """Lift and drag coefficients [S, W]; lift to the side that the flow comes to."""
    flow, loads = moved.work.flow, moved.work.loads
    speed = flow[:, SPEED]
    return loads[:, CIRCULATION] / speed * np.sign(flow[:, STREAM_C]), loads[:, DRAG] / speed


@pytest.mark.parametrize("wind", [WIND, -WIND])
def test_replaced_in_whole_the_force_stands_on_the_wing(wind: float) -> None:
    """C_N = 2 C_l sin alpha along the normal, nothing along the chord, whichever way the air flows."""
    moved = Moved("leading_edge_vortex", WHOLE, airspeed=wind)
    moved.rate(Motion(pitch=STEEP), moved.z)
    flow, loads = moved.work.flow, moved.work.loads
    uc, un, q = flow[:, STREAM_C], flow[:, STREAM_N], flow[:, SPEED]
    normal = loads[:, CIRCULATION] * uc + loads[:, DRAG] * un
    chordwise = -loads[:, CIRCULATION] * un + loads[:, DRAG] * uc
    np.testing.assert_allclose(normal, 2 * 1.58 * un * q, rtol=1e-12)
    np.testing.assert_allclose(chordwise, 0.0, atol=1e-12 * WIND**2)


def test_lift_is_that_of_the_sine_and_near_what_was_measured() -> None:
    """C_l sin 2 alpha (Armanini et al., Eq. 3); the fits of Dickinson, Lehmann and Sane (1999) lie about it."""
    degrees = np.array([15.0, 20.0, 30.0, 40.0, 50.0, 60.0, 75.0, 90.0])
    moved = Moved("leading_edge_vortex", WHOLE, airspeed=WIND)
    moved.rate(Motion(pitch=np.radians(degrees)), moved.z)
    lift, drag = coefficients(moved)
    np.testing.assert_allclose(lift[0], 1.58 * np.sin(2 * np.radians(degrees)), atol=1e-12)
    measured_lift = 0.225 + 1.58 * np.sin(np.radians(2.13 * degrees - 7.20))
    measured_drag = 1.92 - 1.55 * np.cos(np.radians(2.04 * degrees - 9.82))
    np.testing.assert_allclose(lift[0], measured_lift, atol=0.25)
    np.testing.assert_allclose(drag[0], measured_drag, atol=0.4)


def test_attached_flow_is_left_alone_and_the_rest_goes_over_smoothly() -> None:
    """Up to the angle nothing, ten degrees on all of the part, half-way half of it."""
    angle, part = 0.3, 0.6
    pitch = angle + np.radians([-10.0, -1.0, 0.0, 2.5, 5.0, 10.0, 12.0, 20.0])
    bare, full, some = (
        Moved("leading_edge_vortex", {"part": p, "angle": angle}, airspeed=WIND) for p in (0.0, 1.0, part)
    )
    for moved in (bare, full, some):
        moved.rate(Motion(pitch=pitch), moved.z)
    lift = 1.58 * np.sin(2 * pitch)
    affine, replaced, blended = (coefficients(moved)[0][0] for moved in (bare, full, some))
    share = (replaced - affine) / (lift - affine)
    np.testing.assert_allclose(share, [0.0, 0.0, 0.0, 0.15625, 0.5, 1.0, 1.0, 1.0], atol=1e-6)
    np.testing.assert_allclose(blended - affine, part * (replaced - affine), atol=1e-12)
    assert some.work.loads[..., :3].tobytes() == bare.work.loads[..., :3].tobytes()


def test_slopes_are_those_of_the_normal_force() -> None:
    """What the linearisation takes, at all angles, lift and drag together."""
    pushed = []
    for change in (-1e-6, 1e-6, 0.0):
        moved = Moved("leading_edge_vortex", WHOLE, airspeed=WIND)
        moved.rate(Motion(heave_rate=-WIND * np.tan(STEEP) - change), moved.z)
        flow, loads = moved.work.flow, moved.work.loads
        pushed.append(loads[:, CIRCULATION] * flow[:, STREAM_C] + loads[:, DRAG] * flow[:, STREAM_N])
    described = moved.work.loads[:, LIFT_SLOPE] + moved.work.loads[:, DRAG_SLOPE]
    np.testing.assert_allclose(described, (pushed[1] - pushed[0]) / 2e-6, rtol=1e-6)
    assert np.all(described > 0)
