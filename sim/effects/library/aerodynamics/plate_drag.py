"""Effect: additional pressure drag of the wing, as of a plate, from the component of the stream along its normal."""

from __future__ import annotations

from typing import Any

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.arrays import DRAG_SLOPE, MEAN_CHORD, PITCH_RATE, PUSH_M, PUSH_N, STREAM_N
from wingfit.sim.kernels.lanes.vector import load, magnitude, store
from wingfit.sim.kernels.laws import strip_port

# Gauss and Legendre's four points of the chord, from its middle, and their weights: within 1 % where the flow turns.
_POINTS = ((-0.430568, 0.173927), (-0.169991, 0.326073), (0.169991, 0.326073), (0.430568, 0.173927))


def _law(frame: Any, moment: int) -> None:
    """Add the pressure rho / 2 C |w| w along the normal at every point x of the chord.

    w = u_n + theta' x is the flow along the normal (m/s) there: u_n at mid-chord, where x = 0, theta' the pitch rate; C
    is the effect's coefficient. A strip that does not pitch thus has the additional normal force coefficient C |sin
    alpha| sin alpha at the angle of attack alpha (the cross-flow principle). A strip that only pitches about its middle
    is held back by the moment rho / 2 C |theta'| theta' c^4 / 32 per span (chord c). ``frame`` and ``moment``: see
    :mod:`wingfit.sim.kernels.laws`.
    """
    port = strip_port(frame)
    for s in range(port.places):
        un, turn = load(port.flow, s, STREAM_N), load(port.flow, s, PITCH_RATE)
        drag, chord = load(port.parameters, 0, s), port.geometry[s, MEAN_CHORD]
        force, moment_up = 0.0 * un, 0.0 * un
        for place, weight in _POINTS:
            w = un + (place * chord) * turn
            pressure = (weight * drag) * magnitude(w) * w
            force += pressure
            moment_up = moment_up - (place * chord) * pressure
        store(port.loads, s, PUSH_N, load(port.loads, s, PUSH_N) + force)
        store(port.loads, s, PUSH_M, load(port.loads, s, PUSH_M) + moment_up)
        store(port.loads, s, DRAG_SLOPE, load(port.loads, s, DRAG_SLOPE) + 2.0 * drag * magnitude(un))


def _wing(scene: WingScene, values: Values) -> None:
    scene.add_strip_law(_law, [values["coefficient"]])


_TEXT = "drag coefficient at 90 deg beyond that of the affine law; a plate has 1.2 to 2 in all"

EFFECT = effect_of_air(
    name="plate_drag",
    title="Normal plate drag",
    size=(Parameter("coefficient", "1", 0.0, 2.0, 0.5, _TEXT),),
    power="dissipative",
    law="dF_n = coefficient (rho / 2) |w| w dx dy,     w = u_n + theta' x",
    source="Hoerner (1965), Fluid-Dynamic Drag, ch. III: plates across the stream and the cross-flow principle; "
    "Armanini et al. (2016), Eq. 11, has the same form, C_Dpi/2 sin^2 alpha",
    signature="a force resists the motion of the wing along its normal and grows with the square of that speed, at any "
    "airspeed",
    confused_with=("leading_edge_vortex", "viscous_drag"),
    wing=_wing,
)
