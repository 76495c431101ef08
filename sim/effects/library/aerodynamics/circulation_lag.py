"""Effect: circulation lags behind the wing's motion while the vortices that it has shed are near (Wagner)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene, deferred
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.arrays import CIRCULATION, LIFT_SLOPE, MEAN_CHORD, SPEED
from wingfit.sim.kernels.lanes.vector import load, store
from wingfit.sim.kernels.laws import strip_port

Array = npt.NDArray[np.float64]

DEFICIT = (0.165, 0.335)  # R. T. Jones (1940): phi(s) = 1 - sum_i DEFICIT_i exp(-RATE_i s), s in half chords
RATE = (0.0455, 0.3)  # per half chord travelled
_SCALE = 0.1  # motion of the wing over the integral of a lagging circulation, as speed times lift coefficient


def wagner(s: npt.ArrayLike) -> Array:
    """Return the fraction of the final circulation ``s`` half chords after a step of the angle (Jones 1940)."""
    travelled = np.asarray(s, float)
    return np.asarray(1.0 - sum(a * np.exp(-b * travelled) for a, b in zip(DEFICIT, RATE, strict=True)))


def _lag(scene: VehicleScene, values: Values) -> None:
    """Replace the circulation Gamma of a vehicle's wings by Gamma - share sum_i DEFICIT_i (Gamma - x_i).

    The two states follow x_i' = RATE_i rate (2 V / c) (Gamma - x_i): V is the speed of the flow, c the chord; share and
    rate are the effect's parameters.
    """
    flow = scene.flow
    per_metre = values["rate"][:, None] * (2.0 / scene.chords)
    share, quasi_steady = values["share"][:, None, None], flow.circulation
    delayed = quasi_steady * (1.0 - share * sum(DEFICIT))
    for a, b in zip(DEFICIT, RATE, strict=True):
        late = scene.follow(b * per_metre, quasi_steady)
        late *= share * a
        delayed += late
    flow.circulation = delayed


def _law(frame: Any, moment: int) -> None:
    """Change the loads of a wing's strips as :func:`_lag` does; Gamma is represented by 2 Gamma / c.

    This is the speed times the lift coefficient. ``frame`` and ``moment``: see :mod:`wingfit.sim.kernels.laws`.
    """
    port = strip_port(frame)
    for s in range(port.places):
        share = load(port.parameters, 0, s)
        half_chords = load(port.parameters, 1, s) * load(port.flow, s, SPEED) * (2.0 / port.geometry[s, MEAN_CHORD])
        quasi_steady = load(port.loads, s, CIRCULATION)
        lacking = quasi_steady * 0.0
        for k in range(2):
            fading = half_chords * RATE[k]
            deficit = quasi_steady - load(port.state, k, s)
            store(port.rate, k, s, fading * deficit)
            store(port.decay, k, s, fading)
            lacking += deficit * DEFICIT[k]
        store(port.loads, s, CIRCULATION, quasi_steady - share * lacking)
        at_once = 1.0 - share * (DEFICIT[0] + DEFICIT[1])
        store(port.loads, s, LIFT_SLOPE, load(port.loads, s, LIFT_SLOPE) * at_once)


def _wing(scene: WingScene, values: Values) -> None:
    seconds = _SCALE / scene.angular_rate
    scene.add_strip_law(_law, [values["share"], values["rate"]], states=[seconds, seconds])


EFFECT = effect_of_air(
    name="circulation_lag",
    title="Lagged circulation (Wagner, Theodorsen)",
    size=(
        Parameter(
            "share", "1", 0.0, 1.5, 1.0, "fraction of Wagner's deficit of circulation; 1 for a thin wing in plane flow"
        ),
    ),
    shape=(
        Parameter(
            "rate",
            "1",
            0.3,
            5.0,
            1.0,
            "rate of both states, relative to plane flow; above 1 of a finite wing",
            scale="log",
        ),
    ),
    memory="two lagging circulations at each station of a vehicle's wing or strip of a flexible wing",
    law="x_i' = rate b_i (2 V / c) (Gamma_0 - x_i),     i = 1, 2\nGamma = Gamma_0 - share sum_i a_i (Gamma_0 - x_i)",
    source="Wagner (1925), in the approximation of R. T. Jones (1940), NACA Report 681, which has finite wings too and "
    "for a steady oscillation is the function of Theodorsen (1935), NACA Report 496; Leishman (2006), ch. 8: the same "
    "with internal states",
    signature="lift is late and varies less, and its delay is the same number of half chords travelled at any flap "
    "frequency",
    confused_with=("dynamic_stall", "wake_capture", "filter_delay", "clock_offset"),
    wing=_wing,
    vehicle=deferred("circulation", _lag),
)
