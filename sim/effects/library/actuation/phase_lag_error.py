"""Effect: the lag of the rear driving rod behind the front one is larger than described in the dataset."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, effect_of_drive
from wingfit.sim.effects.ports.wing import WingScene


def _wing(scene: WingScene, values: Values) -> None:
    harmonics = np.arange(len(scene.rods.series))
    scene.rods.series[:, 1] *= np.exp(-1j * harmonics[:, None] * values["angle"])


EFFECT = effect_of_drive(
    name="phase_lag_error",
    of_rods=True,
    title="Phase lag error",
    size=(Parameter("angle", "rad", -0.4, 0.4, 0.02, "lag of the rear rod beyond the described lag, in drive phase"),),
    law="zeta_rear(psi) = zeta(psi - lag - angle)",
    source="van der Grinten, The bird is the word, section III-F: lags of 0, 3 and 7 degrees; Bracewell (1965), ch. 6: "
    "shift theorem of Fourier series",
    signature="the wing twists in phase with the flap rate, most where it moves fastest, and alike in every condition",
    confused_with=("hinge_tilt", "rolling_shutter"),
    wing=_wing,
)
