"""Circulation of a wing that pitches: the Kramer effect."""

from __future__ import annotations

from typing import Any

from sim.effects.contract import Effect, Parameter, Values
from sim.effects.wing import WingScene
from sim.kernels.arrays import CIRCULATION, MEAN_CHORD, PITCH_RATE
from sim.kernels.laws import AFTER, strip_port
from sim.kernels.vector import load, store


def _law(frame: Any, moment: int) -> None:
    """Gamma = C_r (3/4 - x_0) c^2 theta' / 2, that is twice Gamma over the chord more to speed times lift coefficient."""
    if moment != AFTER:
        return
    port = strip_port(frame)
    for s in range(port.places):
        lever = load(port.parameters, 0, s) * (0.75 - load(port.parameters, 1, s))
        more = lever * load(port.flow, s, PITCH_RATE) * port.geometry[s, MEAN_CHORD]
        store(port.loads, s, CIRCULATION, load(port.loads, s, CIRCULATION) + more)


def _wing(scene: WingScene, values: Values) -> None:
    scene.add_strip_law(_law, [values["C_r"], values["x_0"]])


EFFECT = Effect(
    name="rotational_circulation",
    title="Rotational circulation",
    family="aerodynamics",
    port="air",
    size=(Parameter("C_r", "1", -6.3, 6.3, 3.14159, "coefficient of rotational circulation (thin airfoils: pi)"),),
    shape=(
        Parameter("x_0", "1", -0.25, 0.7, 0.4, "axis about which the section pitches, part of the chord", place=True),
    ),
    source="Sane and Dickinson, Journal of Experimental Biology 205, 1087 (2002), Eq. 4; Ellington, Philosophical "
    "Transactions B 305, 79 (1984); Armanini et al. (2016), Eqs. 2 and 4",
    signature="a force across the stream where the wing pitches fast, at the stroke's ends; grows with density, pitch "
    "rate and speed",
    confused_with=("added_mass", "wake_capture", "circulation_lag"),
    wing=_wing,
)
