"""Effect: the drive adds second, third and fourth harmonics to the stroke described in the dataset."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, effect_of_drive
from wingfit.sim.effects.ports.vehicle import VehicleScene
from wingfit.sim.effects.ports.wing import WingScene

HARMONICS = {2: 0.02, 3: 0.02, 4: 0.01}
"""Order and typical size of each; in a four-bar linkage with wrong lengths each is smaller than the one before."""
_TEXT = "{} amplitude of harmonic {} of the flap angle, over the amplitude of the first harmonic"


def _vehicle(scene: VehicleScene, values: Values) -> None:
    amplitude = np.abs(scene.flap[:, 1])
    for k in HARMONICS:
        scene.add_harmonic(k, amplitude * (values[f"cos{k}"] - 1j * values[f"sin{k}"]))


def _wing(scene: WingScene, values: Values) -> None:
    """Add the harmonics to the angle of both rods; the rear rod makes the same error, later by its lag."""
    rods, lag = scene.rods, scene.condition.phase_lag
    rods.lengthened(max(HARMONICS))
    amplitude = np.abs(rods.series[1, 0])
    for k in HARMONICS:
        error = amplitude * (values[f"cos{k}"] - 1j * values[f"sin{k}"])
        rods.series[k] += error * np.exp(-1j * k * np.array([[0.0], [lag]]))


EFFECT = effect_of_drive(
    name="drive_harmonics",
    title="Higher harmonics of the drive",
    size=tuple(
        Parameter(f"{wave}{k}", "1", -5.0 * typical, 5.0 * typical, typical, _TEXT.format(what, k))
        for k, typical in HARMONICS.items()
        for wave, what in (("cos", "cosine"), ("sin", "sine"))
    ),
    law="zeta' = zeta + a_1 (cos2 cos 2 psi + sin2 sin 2 psi + ... + cos4 cos 4 psi + sin4 sin 4 psi)",
    source="Freudenstein (1955): the leading errors of a four-bar linkage with wrong lengths",
    signature="the same error appears two, three or four times a beat, at the same drive phases in every condition",
    confused_with=("stroke_amplitude", "tracker_lag"),
    wing=_wing,
    vehicle=_vehicle,
)
