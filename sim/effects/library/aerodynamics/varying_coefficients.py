"""Effect: coefficients of circulation that change with flap frequency and body pitch."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Array, Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene

REFERENCE_FREQUENCY = 12.0  # Hz: at this and the pitch below, coefficients equal their genes
REFERENCE_PITCH = 1.0  # rad; both lie among the eight tests of the source
LIFT = ("C_l", "K_l")  # circulation of the angle of attack, by either law


def factor(frequency: float, pitch: float, by_frequency: Array, by_pitch: Array) -> Array:
    """Return a factor [B] on a coefficient at a flap ``frequency`` (Hz) and body ``pitch`` (rad); never below zero.

    ``by_frequency`` [B]: change per relative change of frequency from REFERENCE_FREQUENCY; ``by_pitch`` [B]: change per
    rad from REFERENCE_PITCH; B individuals.
    """
    more = by_frequency * (frequency / REFERENCE_FREQUENCY - 1.0) + by_pitch * (pitch - REFERENCE_PITCH)
    return np.asarray(np.maximum(1.0 + more, 0.0))


def _vary(scene: VehicleScene, values: Values) -> None:
    """Scale the coefficients C_l, K_l and C_F of the scene, and the fling of the effect clap_and_peel."""
    here = scene.setting.condition

    def changed(kind: str) -> Array:
        slopes = (values[f"{kind}_by_{variable}"] for variable in ("frequency", "pitch"))
        return factor(here.flap_frequency, here.angle_of_attack, *slopes)

    lift, fling = changed("lift"), changed("fling")
    factors = dict.fromkeys(LIFT, lift) | {"C_F": fling}
    scene.genes = {name: value * factors[name] if name in factors else value for name, value in scene.genes.items()}
    scene.fling = scene.fling * fling


EFFECT = effect_of_air(
    name="varying_coefficients",
    title="Coefficients that vary with flight",
    size=(
        Parameter(
            "lift_by_frequency",
            "1",
            -8.0,
            8.0,
            -3.5,
            "relative change of C_l or K_l per relative change of flap frequency",
        ),
        Parameter("lift_by_pitch", "1/rad", -2.0, 2.0, 0.1, "relative change of C_l or K_l per radian of body pitch"),
        Parameter(
            "fling_by_frequency", "1", -8.0, 8.0, 1.6, "relative change of C_F per relative change of flap frequency"
        ),
        Parameter("fling_by_pitch", "1/rad", -2.0, 2.0, 0.3, "relative change of C_F per radian of body pitch"),
    ),
    law="C_l' = C_l max(1 + lift_by_frequency (f / f_0 - 1) + lift_by_pitch (theta_b - theta_0), 0)\n"
    "C_F' = C_F max(1 + fling_by_frequency (f / f_0 - 1) + fling_by_pitch (theta_b - theta_0), 0)",
    source="Armanini et al. (2016), Eq. 23: C_l and C_F are affine in flap frequency and body pitch, and C_r is the "
    "mean over the tests; the typical sizes are from Table 8",
    signature="the model fits each recording by itself but not all together, because lift is too small in some "
    "conditions and too large in others, with the same shape over the beat",
    confused_with=("circulation_lag", "tip_loss", "mass_offset", "dynamic_stall", "stall_vortex"),
    vehicle=_vary,
    descriptive=True,
)
