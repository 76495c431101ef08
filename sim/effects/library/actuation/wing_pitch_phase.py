"""Effect: the wing pitches later than described in the dataset."""

from __future__ import annotations

from wingfit.sim.effects.contract import Parameter, Values, effect_of_drive
from wingfit.sim.effects.ports.vehicle import VehicleScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    scene.pitch = scene.pitch._replace(lag=values["lag"])


EFFECT = effect_of_drive(
    name="wing_pitch_phase",
    title="Wing pitch phase error",
    size=(Parameter("lag", "1", -0.15, 0.15, 0.02, "delay of the wing pitch, as a fraction of the beat"),),
    law="theta_w'(t*) = theta_w(t* - lag)",
    source="Dickinson, Lehmann and Sane (1999), Science 284, 1954: the phase of rotation decides the "
    "sign of the force at stroke reversal",
    signature="the force at both stroke reversals changes, and the rest of the beat hardly does",
    confused_with=("wake_capture", "circulation_lag", "clock_offset"),
    vehicle=_vehicle,
)
