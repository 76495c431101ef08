"""The drive adds second and third harmonics to the stroke that it is said to make."""

from __future__ import annotations

import numpy as np

from sim.effects.contract import Effect, Parameter, Values
from sim.effects.vehicle import VehicleScene
from sim.effects.wing import WingScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    amplitude = np.abs(scene.flap[:, 1])
    for k in (2, 3):
        scene.add_harmonic(k, amplitude * (values[f"cos{k}"] - 1j * values[f"sin{k}"]))


def _wing(scene: WingScene, values: Values) -> None:
    """The rear rod makes the same error, later by its lag."""
    rods, lag = scene.rods, scene.condition.phase_lag
    rods.lengthened(3)
    amplitude = np.abs(rods.series[1, 0])
    for k in (2, 3):
        error = amplitude * (values[f"cos{k}"] - 1j * values[f"sin{k}"])
        rods.series[k] += error * np.exp(-1j * k * np.array([[0.0], [lag]]))


EFFECT = Effect(
    name="drive_harmonics",
    title="Higher harmonics of the drive",
    family="actuation",
    port="drive",
    size=tuple(
        Parameter(
            f"{wave}{k}",
            "1",
            -0.1,
            0.1,
            0.02,
            f"{'cosine' if wave == 'cos' else 'sine'} of harmonic {k} of the drive, in parts of its first harmonic",
        )
        for k in (2, 3)
        for wave in ("cos", "sin")
    ),
    source=(
        "zeta + a_1 sum_k [cos_k cos(2 pi k t*) + sin_k sin(2 pi k t*)], k = 2, 3: the leading errors of a four-bar "
        "linkage whose lengths are off (Freudenstein 1955)"
    ),
    signature="the same error twice or three times a beat at the same drive phases in every condition",
    confused_with=("stroke_amplitude", "tracker_lag"),
    wing=_wing,
    vehicle=_vehicle,
)
