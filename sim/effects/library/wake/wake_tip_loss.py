"""Effect: circulation falls to zero at the tip, over a distance that the speed of the wake decides."""

from __future__ import annotations

import numpy as np

from wingfit.records.dataset import STANDARD_GRAVITY
from wingfit.sim.effects.contract import Array, Parameter, Values, effect_of_air
from wingfit.sim.effects.library.wake.induced_inflow import swept_area
from wingfit.sim.effects.library.wake.tip_loss import prandtl
from wingfit.sim.effects.ports.vehicle import VehicleScene

_ROUNDS = 60


def wake_speed(axial: Array, across: Array, ratio: Array) -> Array:
    """Return the speed [B] (m/s) at which a wake moves away along body x, by momentum theory.

    It is U_x + v, where 2 rho A v ((U_x + v)^2 + U_z^2)^(1/2) = T. ``axial`` U_x and ``across`` U_z [B], m/s; ``ratio``
    [B]: T / (2 rho A), m^2/s^2 (Glauert 1926).
    """
    v = np.sqrt(ratio)
    for _ in range(_ROUNDS):
        v = 0.5 * (v + ratio / np.maximum(np.hypot(axial + v, across), 1e-9))
    return np.asarray(axial + v)


def _vehicle(scene: VehicleScene, values: Values) -> None:
    """Take the weight as thrust; a wake that does not move away would be at the wing, so that no lift is left."""
    vehicle, air = scene.setting.vehicle, scene.setting.condition
    flap = scene.angles.flap[:, 0]
    area = swept_area(scene.span, flap.max(axis=1) - flap.min(axis=1), vehicle.wings)
    ratio = vehicle.mass * STANDARD_GRAVITY / (2.0 * np.maximum(scene.density, 1e-9) * area)
    axial, across = scene.airspeed * np.cos(scene.incidence), scene.airspeed * np.sin(scene.incidence)
    spacing = values["share"] * np.maximum(wake_speed(axial, across, ratio), 0.0) / (2.0 * air.flap_frequency)
    scene.load(lambda r: prandtl(scene.length[:, None] * (vehicle.span - r), np.maximum(spacing, 1e-9)[:, None]))


EFFECT = effect_of_air(
    name="wake_tip_loss",
    title="Tip loss by a wake that the flow carries away",
    size=(
        Parameter(
            "share", "1", 0.0, 2.0, 0.5, "spacing of the vortex sheets over the way of the wake in a half stroke"
        ),
    ),
    law="F = (2 / pi) arccos exp(-pi (R - r) / s),     s = share (U_x + v) / (2 f)\n"
    "2 rho A v ((U_x + v)^2 + U_z^2)^(1/2) = m g",
    source="Prandtl in Betz (1919); Glauert (1935), Aerodynamic Theory, division L, chapter VII: the spacing is "
    "the way of the wake between two blades",
    signature="the outer wing carries less load, and the more so the faster the stream and the slower the flapping",
    confused_with=("tip_loss", "induced_inflow", "varying_coefficients"),
    vehicle=_vehicle,
)
