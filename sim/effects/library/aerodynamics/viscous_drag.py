"""Effect: friction of the air along the wing's skin, in a laminar boundary layer."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.arrays import MEAN_CHORD, PUSH_C, STREAM_C
from wingfit.sim.kernels.lanes.vector import load, magnitude, root, store
from wingfit.sim.kernels.laws import strip_port

_BLASIUS = 2 * 1.328  # both faces


def viscosity(temperature: float) -> float:
    """Return the dynamic viscosity of air (Pa s) at ``temperature`` (K), whatever its pressure (Sutherland 1893)."""
    return 1.458e-6 * temperature * math.sqrt(temperature) / (temperature + 110.4)


def _law(frame: Any, moment: int) -> None:
    """Add to each strip a friction force along the chord, with the coefficient part 2.656 / sqrt(Re) for both faces.

    Re = |u_c| c / nu is the Reynolds number of the chord c and the velocity u_c of the stream along it; ``part`` is the
    effect's size, nu the kinematic viscosity. ``frame`` and ``moment``: see :mod:`wingfit.sim.kernels.laws`.
    """
    port = strip_port(frame)
    for s in range(port.places):
        along = load(port.flow, s, STREAM_C)
        more = load(port.parameters, 0, s) * root(magnitude(along)) * along
        store(port.loads, s, PUSH_C, load(port.loads, s, PUSH_C) + more)


def _wing(scene: WingScene, values: Values) -> None:
    chord = scene.structure.wiring.geometry[:, MEAN_CHORD, None]
    mu = viscosity(scene.condition.temperature)
    with np.errstate(divide="ignore"):
        kinematic = np.where(scene.density > 0.0, mu / scene.density, 0.0)
    scene.add_strip_law(_law, [_BLASIUS * values["part"] * np.sqrt(kinematic / chord)])


_TEXT = "skin friction over that of a smooth flat plate; rough skin has more than 1"

EFFECT = effect_of_air(
    name="viscous_drag",
    title="Viscous drag",
    size=(Parameter("part", "1", 0.0, 20.0, 2.0, _TEXT),),
    power="dissipative",
    law="F_c = part (rho / 2) S 2.656 (nu / c)^(1/2) |u_c|^(1/2) u_c",
    source="Blasius (1908): coefficient 1.328 / sqrt(Re) for each face of a plate; Schlichting (1979), Boundary-Layer "
    "Theory, ch. VII",
    signature="a backward force grows with the 3/2 power of the speed, and in thin air it falls only with the square "
    "root of the density",
    confused_with=("plate_drag", "residual_air"),
    wing=_wing,
)
