"""Effect: wings that touch each other and peel apart produce circulation (fling)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from wingfit.sim.effects.contract import Array, Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.arrays import CHORD_Y, CHORD_Z, CIRCULATION, MEAN_CHORD, PITCH_RATE, PLACE_Y, PLACE_Z
from wingfit.sim.kernels.lanes.vector import greatest, least, load, store
from wingfit.sim.kernels.laws import strip_port

NEAR = 0.2  # chords from mid-chord to the mirror plane at which fling has fallen to a half
_PHASES = 360  # number of drive phases among which the top of the stroke is searched


def fling_near(distance: Array) -> Array:
    """Return the circulation of fling at ``distance`` (chords) from the mirror plane, over that of touching wings.

    Two plates that open side by side suck air into the gap. For a narrow gap, Gamma = omega c^2 / (8 distance)
    (Lighthill 1973), with the opening rate omega (rad/s) and the chord c. With a coefficient of 2.7, the circulation
    2.7 / 2 c^2 omega times this function agrees with it within a tenth of omega c^2 from 0.15 to 1 chord, and it stays
    finite where the wings touch.
    """
    return np.asarray(1.0 / (1.0 + (distance / NEAR) ** 2))


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.fling = scene.fling + values["coefficient"]


def _law(frame: Any, moment: int) -> None:
    """Add to each strip the circulation Gamma = C c^2 omega / 2 while it turns nose down at the rate omega (rad/s).

    C is the coefficient, c the chord. A plane above the wing mirrors it: a strip that turns nose down opens the gap
    between the wing and its mirror image. Gamma falls with the distance of mid-chord from the plane, and with the angle
    between chord and plane: from 45 degrees on, two plates have no more circulation than each by itself. The parameters
    are C, the sine and cosine of the plane's angle, and its distance from the world's origin (m). ``frame`` and
    ``moment``: see :mod:`wingfit.sim.kernels.laws`.
    """
    port = strip_port(frame)
    for s in range(port.places):
        sine, cosine = load(port.parameters, 1, s), load(port.parameters, 2, s)
        chord = port.geometry[s, MEAN_CHORD]
        below = load(port.flow, s, PLACE_Y) * sine - load(port.flow, s, PLACE_Z) * cosine - load(port.parameters, 3, s)
        apart = greatest(below * (1.0 / (NEAR * chord)), 0.0)
        open_ = load(port.flow, s, CHORD_Z) * cosine - load(port.flow, s, CHORD_Y) * sine
        narrow = least(greatest(1.0 - open_ * math.sqrt(2.0), 0.0), 1.0)
        opening = greatest(-load(port.flow, s, PITCH_RATE), 0.0)
        fling = load(port.parameters, 0, s) * chord * opening * narrow / (apart * apart + 1.0)
        store(port.loads, s, CIRCULATION, load(port.loads, s, CIRCULATION) + fling)


def _wing(scene: WingScene, values: Values) -> None:
    """Add the law, with a mirror plane through the flapping axis.

    It is inclined by ``clearance`` (rad) beyond the largest value over the beat of the mean angle of both rods.
    """
    phases = 2 * np.pi * np.arange(_PHASES) / _PHASES
    top = scene.rods.angles(phases)[:, :, 0].mean(axis=1).max(axis=0)
    sine, cosine = np.sin(top + values["clearance"]), np.cos(top + values["clearance"])
    hinge = scene.lanes.hinge[7] * sine - scene.lanes.hinge[8] * cosine
    scene.add_strip_law(_law, [values["coefficient"], sine, cosine, hinge])


_TEXT = "circulation while the wings peel, in units of c^2 (-theta') / 2 (C_F + C_R in Armanini et al. 2016)"
_CLEARANCE = "angle between wing and mirror plane at the top of the stroke; of a wing only"

EFFECT = effect_of_air(
    name="clap_and_peel",
    title="Clap and peel",
    size=(Parameter("coefficient", "1", 0.0, 8.0, 2.7, _TEXT),),
    shape=(Parameter("clearance", "rad", 0.0, 0.5, 0.0, _CLEARANCE, wing_only=True),),
    law="Gamma_f = (coefficient / 2) c^2 max(-theta', 0) g(h / c) max(1 - 2^(1/2) sin chi, 0)\n"
    "g(d) = 1 / (1 + (d / 0.2)^2)",
    source="Armanini et al. (2016), Eq. 7: fling from t* = 0 until the wings stop peeling; Weis-Fogh (1973) and "
    "Lighthill (1973): potential flow of two opening plates, for the decay with gap and angle on a wing",
    signature="the force has a peak at the start of the beat, while the wings open, and is unchanged after it",
    confused_with=("wake_capture", "drive_harmonics"),
    term="clap_and_peel",
    wing=_wing,
    vehicle=_vehicle,
)
