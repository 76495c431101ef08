"""Effect: a stiffness that changes slowly while the wing is recorded: foam that warms, glue that relaxes."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, effect_of_joints
from wingfit.sim.effects.ports.wing import WingScene


def _wing(scene: WingScene, values: Values) -> None:
    scene.lanes.stiffness[:] *= 1.0 + values["part"]


_TEXT = "change of all stiffnesses from the start of each recording to its end, as a fraction of their mean"

EFFECT = effect_of_joints(
    name="stiffness_drift",
    title="Stiffness that drifts",
    size=(Parameter("part", "1", -0.8, 0.8, -0.1, _TEXT),),
    power="conservative",
    law="k(t) = k_0 (1 + part ((t - t_1) / (t_2 - t_1) - 1/2)),     t_1 <= t <= t_2",
    source="Gibson and Ashby (1997), Cellular Solids, 2nd ed., ch. 6: the modulus of a foam falls linearly with its "
    "temperature; Ferry (1980), Viscoelastic Properties of Polymers: relaxation",
    signature="amplitude and phase of the wing change slowly from the first beat of a recording to its last, most at "
    "the tip, and the next recording begins as the last one did",
    confused_with=("strobe_rate", "viscoelastic"),
    during=True,
    wing=_wing,
)
