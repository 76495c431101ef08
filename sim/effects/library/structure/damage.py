"""Effect: a place along the span where the wing has lost stiffness, or where a repair has added some."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Array, Parameter, Values, effect_of_joints
from wingfit.sim.effects.ports.joints import Joints
from wingfit.sim.effects.ports.wing import WingScene

_POINTS = 64  # along a connector: exact to 1e-3 for the narrowest damage on four strips


def _wing(scene: WingScene, values: Values) -> None:
    factor = remaining(Joints.of(scene.structure), values)[:, None]
    scene.lanes.stiffness[:] *= factor
    scene.lanes.damping[:] *= factor  # lost foam does not damp


def remaining(joints: Joints, values: Values) -> Array:
    """Return the fraction [C, W] of the stiffness that remains in each connector (C connectors, W individuals).

    At the position s of the span, 1 - loss exp(-((s - station) / width)^2 / 2) remains. The pieces of a connector along
    the span are in series, so that their compliances add; those of one along the chord are in parallel.
    """
    s = joints.reach[:, :1] + (np.arange(_POINTS) + 0.5) / _POINTS * np.diff(joints.reach)
    away = (s[:, :, None] - values["station"]) / values["width"]
    left = 1.0 - values["loss"] * np.exp(-0.5 * away**2)
    in_a_row, abreast = 1.0 / (1.0 / left).mean(axis=1), left.mean(axis=1)
    return np.asarray(np.where(joints.along_span[:, None], in_a_row, abreast))


EFFECT = effect_of_joints(
    name="damage",
    title="Local loss of stiffness",
    size=(
        Parameter(
            "loss", "1", -2.0, 0.9, 0.5, "fraction of stiffness and damping lost at the station; negative for a gain"
        ),
    ),
    shape=(
        Parameter(
            "station",
            "1",
            0.0,
            1.0,
            0.5,
            "position along the span, as a fraction of the span from root to tip",
            place=True,
        ),
        Parameter(
            "width",
            "1",
            0.02,
            0.3,
            0.06,
            "standard deviation of the loss along the span, as a fraction of the span",
            place=True,
        ),
    ),
    law="k(s) = k_0 (1 - loss exp(-((s - station) / width)^2 / 2))",
    source="Christides and Barr (1984), International Journal of Mechanical Sciences 26, 639: a crack as a local loss "
    "of bending stiffness; Sinha, Friswell and Edwards (2002), Journal of Sound and Vibration 251, 13",
    signature="all markers outboard of one station swing further than the model predicts, and all markers inboard of "
    "it move as predicted",
    confused_with=("cubic_stiffness", "lumped_mass"),
    wing=_wing,
)
