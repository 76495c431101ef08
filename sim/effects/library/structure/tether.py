"""Effect: a spring and a damper between one place of the wing and the ground, such as a cable or a hose."""

from __future__ import annotations

from typing import Any

from wingfit.sim.effects.contract import Effect, Parameter, Values, place
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.lanes.vector import load, load0, store, store0
from wingfit.sim.kernels.laws import point_port


def _law(frame: Any, moment: int) -> None:
    """Add the force -k (x - x_0) - c v on the tethered point, in the world.

    x is its position (m), v its velocity. The parameters of the law are k (N/m), c (N s/m) and the three coordinates of
    x_0, the position at rest (m). ``frame`` and ``moment``: see :mod:`wingfit.sim.kernels.laws`.
    """
    port = point_port(frame)
    stored, lost = load0(port.stored), load0(port.lost)
    for p in range(port.places):
        spring, damper = load(port.parameters, 0, p), load(port.parameters, 1, p)
        for i in range(3):
            stretch = load(port.place, p, i) - load(port.parameters, 2 + i, p)
            velocity = load(port.twist, p, 3 + i)
            pull, drag = spring * stretch, damper * velocity
            store(port.wrench, p, 3 + i, load(port.wrench, p, 3 + i) - pull - drag)
            diagonal = 7 * (3 + i)
            store(port.stiffness, p, diagonal, load(port.stiffness, p, diagonal) + spring)
            store(port.damping, p, diagonal, load(port.damping, p, diagonal) + damper)
            stored += 0.5 * pull * stretch
            lost += drag * velocity
    store0(port.stored, stored)
    store0(port.lost, lost)


def _wing(scene: WingScene, values: Values) -> None:
    at = values["station"], values["chord"]
    scene.add_point_law(_law, *at, [values["k"], values["c"], *scene.at_rest(*at)])


EFFECT = Effect(
    name="tether",
    title="Tether to the ground",
    family="structure",
    port="point",
    size=(
        Parameter("k", "N/m", 0.0, 20.0, 1.0, "stiffness of the spring between the wing and the ground"),
        Parameter("c", "N s/m", 0.0, 0.5, 0.01, "damping constant of the damper beside this spring"),
    ),
    shape=place(0.9, 0.5),
    power="dissipative",
    law="F = -k (x - x_0) - c v,     P = c |v|^2",
    source="Rayleigh (1877), The Theory of Sound, ch. IV: potential energy and dissipation function of a point; "
    "Blevins (1979), Formulas for Natural Frequency and Mode Shape, ch. 8: beams on springs",
    signature="near one place the wing is held back towards its rest position, in vacuum as in air, and less so at "
    "higher flap frequencies, where the inertia grows and the spring does not",
    confused_with=("cable", "lumped_mass", "cubic_stiffness", "damage"),
    wing=_wing,
)
