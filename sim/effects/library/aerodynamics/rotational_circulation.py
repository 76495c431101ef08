"""Effect: circulation that a wing has because it pitches (Kramer effect)."""

from __future__ import annotations

from typing import Any

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.arrays import CIRCULATION, MEAN_CHORD, PITCH_RATE
from wingfit.sim.kernels.lanes.vector import load, store
from wingfit.sim.kernels.laws import strip_port

_LEVER = 0.75 - 0.5  # of a chord: from where the strip's angle of attack is taken to the point that sets circulation


def _law(frame: Any, moment: int) -> None:
    """Add the circulation Gamma = C_r (3/4 - x_0) c^2 theta' / 2 of the pitch rate theta' to each strip.

    C_r is the effect's coefficient, c the chord. Gamma is represented by 2 Gamma / c, speed times lift coefficient. x_0
    is 1/2, because the flow of a strip is taken at mid-chord. In flow from behind, the point that sets the circulation
    is at 1/4 of the chord and the flow is reversed: Gamma is the same, and the force, Gamma times the stream, changes
    its sign. ``frame`` and ``moment``: see :mod:`wingfit.sim.kernels.laws`.
    """
    port = strip_port(frame)
    for s in range(port.places):
        lever = load(port.parameters, 0, s) * (_LEVER * port.geometry[s, MEAN_CHORD])
        more = lever * load(port.flow, s, PITCH_RATE)
        store(port.loads, s, CIRCULATION, load(port.loads, s, CIRCULATION) + more)


def _wing(scene: WingScene, values: Values) -> None:
    scene.add_strip_law(_law, [values["coefficient"]])


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.include("rotation", values["coefficient"], "C_r")


EFFECT = effect_of_air(
    name="rotational_circulation",
    title="Rotational circulation",
    size=(
        Parameter(
            "coefficient", "1", -10.0, 10.0, 6.2832, "coefficient of rotational circulation; 2 pi for thin airfoils"
        ),
    ),
    law="Gamma_r = coefficient (3/4 - x_0) c^2 theta' / 2,     x_0 = 1/2",
    source="Sane and Dickinson (2002), Journal of Experimental Biology 205, 1087: circulation pi (3/4 - x_0) omega "
    "c^2; Ellington (1984), Philosophical Transactions B 305, 79; Armanini et al. (2016), Eqs. 2 and 4",
    signature="a force across the stream acts where the wing pitches fast, at the ends of the stroke, and grows with "
    "air density, pitch rate and speed",
    confused_with=("added_mass", "wake_capture", "circulation_lag"),
    term="rotation",
    wing=_wing,
    vehicle=_vehicle,
)
