"""Effect: at large angles of attack a vortex stays over the leading edge; the force is then normal to the wing."""

from __future__ import annotations

import math
from typing import Any

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.arrays import (
    ALPHA,
    CIRCULATION,
    DRAG,
    DRAG_SLOPE,
    FORWARD,
    LIFT_SLOPE,
    SPEED,
    STREAM_C,
    STREAM_N,
)
from wingfit.sim.kernels.lanes.vector import greatest, least, load, magnitude, store
from wingfit.sim.kernels.laws import strip_port

_BLEND = math.radians(10.0)  # over which the vortex takes over


def _law(frame: Any, moment: int) -> None:
    """Blend lift and drag coefficients of strips from the affine laws to those of a wing with a leading-edge vortex.

    A fraction w of C_L and C_D is replaced by C_L = C_l sin 2 alpha and C_D = 2 C_l sin^2 alpha, where C_l is the
    effect's coefficient and alpha the angle of attack. Together these are C_N = 2 C_l sin alpha along the normal and
    nothing along the chord, because without suction at the leading edge the pressure on a thin wing acts along its
    normal. w grows smoothly with |alpha|, from 0 at the angle where attached flow ends to the parameter ``part`` 10
    degrees later. This form has one coefficient, is valid up to 90 degrees, and agrees with measurements on flapping
    wings; the suction analogy (Polhamus 1966) is for slender wings in steady flow. The parameters are part, C_l, that
    angle, and the four coefficients of the affine laws. ``frame`` and ``moment``: see :mod:`wingfit.sim.kernels.laws`.
    """
    port = strip_port(frame)
    P, flow, loads = port.parameters, port.flow, port.loads
    for s in range(port.places):
        q, uc, un = load(flow, s, SPEED), load(flow, s, STREAM_C), load(flow, s, STREAM_N)
        size, alpha = magnitude(load(flow, s, ALPHA)), load(flow, s, ALPHA)
        x = least(greatest((size - load(P, 2, s)) * (1.0 / _BLEND), 0.0), 1.0)
        part = load(P, 0, s) * x * x * (3.0 - 2.0 * x)
        a, b, d = load(P, 3, s), load(P, 5, s), load(P, 5, s) * size + load(P, 6, s)
        twice, r = 2.0 * load(P, 1, s), 1.0 / q
        cosine2, sine2 = uc * uc * r * r, un * un * r * r
        lift = twice * uc * un * r - q * (a * alpha + load(P, 4, s)) * load(flow, s, FORWARD)
        drag = q * (twice * sine2 - d)
        store(loads, s, CIRCULATION, load(loads, s, CIRCULATION) + part * lift)
        store(loads, s, DRAG, load(loads, s, DRAG) + part * drag)
        # how the normal parts of both grow with the normal speed
        store(loads, s, LIFT_SLOPE, load(loads, s, LIFT_SLOPE) + part * q * (twice * cosine2 * cosine2 - a))
        steeper = twice * sine2 * (3.0 - sine2) - (d + b)
        store(loads, s, DRAG_SLOPE, load(loads, s, DRAG_SLOPE) + part * q * steeper)


def _wing(scene: WingScene, values: Values) -> None:
    own = [values[name] for name in ("part", "coefficient", "angle")]
    scene.add_strip_law(_law, [*own, *scene.lanes.coefficients])


EFFECT = effect_of_air(
    name="leading_edge_vortex",
    title="Leading-edge vortex",
    size=(Parameter("part", "1", 0.0, 1.0, 0.5, "fraction of the affine coefficients that the vortex replaces"),),
    shape=(
        Parameter(
            "coefficient", "1", 0.5, 3.0, 1.58, "half the force coefficient of the wing at 90 deg angle of attack"
        ),
        Parameter("angle", "rad", 0.0, 0.8, 0.26, "angle of attack at which attached flow ends"),
    ),
    law="C_L' = (1 - w) C_L + w coefficient sin 2 alpha\n"
    "C_D' = (1 - w) C_D + w 2 coefficient sin^2 alpha\n"
    "w = part x^2 (3 - 2 x),     x = (|alpha| - angle) / 10 deg, limited to 0..1",
    source="Ellington et al. (1996), Nature 384, 626; Dickinson, Lehmann and Sane (1999), Science 284, 1954: the "
    "measured C_L and C_D vary with about twice the angle of attack, with amplitudes of 1.58 and 1.55; Armanini et "
    "al. (2016), Eq. 3",
    signature="lift and drag differ from the model at large angles of attack in fast strokes, and agree with it while "
    "the flow is attached",
    confused_with=("dynamic_stall", "plate_drag"),
    wing=_wing,
)
