"""Effect: the stroke amplitude is larger than described in the dataset."""

from __future__ import annotations

import numpy as np

from wingfit.records.array_types import Complex
from wingfit.sim.effects.contract import Parameter, Values, effect_of_drive
from wingfit.sim.effects.ports.vehicle import VehicleScene
from wingfit.sim.effects.ports.wing import WingScene

_HARMONICS = 12
"""Highest harmonic of a cube that is kept, unless the described stroke has higher ones."""


def _vehicle(scene: VehicleScene, values: Values) -> None:
    bends = _bends(scene.flap.T, values)
    scene.flap[:, 1:] *= (1.0 + values["part"])[:, None]
    for k, bend in enumerate(bends):
        scene.add_harmonic(k, bend)


def _wing(scene: WingScene, values: Values) -> None:
    rods = scene.rods
    bends = [_bends(rods.series[:, rod], values) for rod in range(rods.series.shape[1])]
    rods.series[1:] *= 1.0 + values["part"]
    rods.lengthened(len(bends[0]) - 1)
    rods.series[: len(bends[0])] += np.stack(bends, axis=1)


def _bends(series: Complex, values: Values) -> Complex:
    """Fourier series [M, W] of -2/3 part linkage (zeta - zeta_0)^3 of strokes zeta with ``series`` [K + 1, W], rad.

    Empty where all are zero. Each individual is transformed by itself, so that it does not depend on the others.
    """
    factor = -2.0 / 3.0 * values["part"] * values["linkage"]
    if not factor.any():
        return np.zeros((0, series.shape[1]), complex)
    order = len(series) - 1
    kept = max(order, min(3 * order, _HARMONICS)) + 1
    return np.stack([size * _cube(one)[:kept] for size, one in zip(factor, series.T, strict=True)], axis=1)


def _cube(series: Complex) -> Complex:
    """Fourier series [4 K + 5] of the cube of a stroke about its mean, of which ``series`` [K + 1] is the series."""
    samples = 8 * len(series)  # no harmonic of the cube is mistaken for a lower one
    spectrum = np.concatenate([[0.0], 0.5 * samples * series[1:]])
    cube = np.fft.rfft(np.fft.irfft(spectrum, samples) ** 3) / samples
    cube[1:] *= 2.0
    return np.asarray(cube)


EFFECT = effect_of_drive(
    name="stroke_amplitude",
    title="Stroke amplitude error",
    size=(
        Parameter(
            "part", "1", -0.4, 0.4, 0.05, "relative error of the stroke; positive if it is larger than described"
        ),
    ),
    shape=(
        Parameter(
            "linkage", "1", -1.0, 1.5, 0.0,
            "how the drive turns its length into the stroke: 0: in proportion, as a scale of the angle does; 1: the "
            "tangent of the angle grows, as on a lever in a slot; -0.5: its sine grows, as on a crank in a yoke",
        ),
    ),
    law="zeta(t) = zeta_0 + x + part (x - 2/3 linkage x^3)\n"
    "x = sum_{k > 0} Re zeta_k exp(2 pi i k t*)",
    source="Armanini et al. (2016), Eqs. 17, 20 and 21: the flap angle, and the wing pitch that follows it and is "
    "scaled too; Norton (2012), Design of Machinery, ch. 3: inverted slider-crank and scotch yoke, here to third order "
    "in the angle",
    signature="displacements grow in proportion to the stroke and forces with its square, and their shape over the "
    "beat hardly changes",
    confused_with=("scale_error", "residual_air"),
    wing=_wing,
    vehicle=_vehicle,
)  # fmt: skip
