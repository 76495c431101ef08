"""Effect: lift depends on the angle of attack by another curve than the sine of twice the angle."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene, deferred


def _curve(scene: VehicleScene, values: Values) -> None:
    """Add ``fourth`` sin 4 alpha to the sin 2 alpha of the circulation; what is due to pitching does not change."""
    flow, fourth = scene.flow, values["fourth"][:, None, None]
    total = flow.along**2 + flow.normal**2
    cosine = np.divide(flow.along**2 - flow.normal**2, total, out=np.zeros_like(total), where=total > 0.0)
    flow.circulation += 2.0 * fourth * cosine * (flow.circulation - scene.wings.rotation)


EFFECT = effect_of_air(
    name="lift_curve",
    title="Another lift curve",
    size=(
        Parameter(
            "fourth",
            "1",
            -0.5,
            0.5,
            0.15,
            "part of sin 4 alpha in the lift coefficient, relative to that of sin 2 alpha",
        ),
    ),
    law="Gamma_alpha' = Gamma_alpha (1 + 2 fourth cos 2 alpha)\nC_L' ~ sin 2 alpha + fourth sin 4 alpha",
    source="Dickinson, Lehmann and Sane (1999), Science 284, 1954, and Wang, Birch and Dickinson (2004), Journal of "
    "Experimental Biology 207, 449: lift of a plate over the angle of attack is nearly sin 2 alpha; derived: the next "
    "term of the Fourier series of a curve that is odd and the same for both directions of the flow along the chord",
    signature="lift grows at small angles of attack and falls at large ones, or the reverse, in both half strokes and "
    "without a delay",
    confused_with=("dynamic_stall", "stall_vortex", "varying_coefficients", "wing_pitch_amplitude"),
    vehicle=deferred("circulation", _curve),
)
