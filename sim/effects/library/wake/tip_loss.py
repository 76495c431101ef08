"""Effect: circulation falls to zero at the tip, where the trailing vortex leaves the wing."""

from __future__ import annotations

from typing import Any

import numpy as np

from wingfit.sim.effects.contract import Array, Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.arrays import CIRCULATION, LIFT_SLOPE
from wingfit.sim.kernels.lanes.vector import load, store
from wingfit.sim.kernels.laws import strip_port
from wingfit.sim.wing.structure import Structure

_PIECES = 64  # pieces of a strip over which the factor is averaged


def prandtl(to_tip: Array, spacing: Array) -> Array:
    """Return Prandtl's factor F on the circulation at ``to_tip`` (m) from the tip.

    F = 2 / pi arccos exp(-pi to_tip / spacing), where the vortex sheets of successive strokes are ``spacing`` (m) apart
    (Prandtl in Betz 1919; Glauert 1935, division L, chapter VII); the arguments broadcast.
    """
    return np.asarray(2.0 / np.pi * np.arccos(np.exp(-np.pi * to_tip / spacing)))


def strip_factors(structure: Structure, spacing: Array) -> Array:
    """Return the mean of Prandtl's factor over the area of every strip, [S, W], for the ``spacing`` [W] (m)."""
    edges = structure.planform.strips(structure.division)
    u = (np.arange(_PIECES) + 0.5) / _PIECES  # pieces grow with u^2: near the tip the factor is as a root
    y = edges[1:, None] - np.diff(edges)[:, None] * u**2
    weight = structure.planform.chord(y) * u
    factor = prandtl((edges[-1] - y)[..., None], spacing)
    return np.asarray(np.einsum("sp,spw->sw", weight / weight.sum(axis=1, keepdims=True), factor))


def _law(frame: Any, moment: int) -> None:
    """Multiply the circulation of each strip by its factor of :func:`strip_factors`, the law's parameter."""
    port = strip_port(frame)
    for s in range(port.places):
        factor = load(port.parameters, 0, s)
        store(port.loads, s, CIRCULATION, factor * load(port.loads, s, CIRCULATION))
        store(port.loads, s, LIFT_SLOPE, factor * load(port.loads, s, LIFT_SLOPE))


def _wing(scene: WingScene, values: Values) -> None:
    scene.add_strip_law(_law, [strip_factors(scene.structure, values["spacing"])])


def _vehicle(scene: VehicleScene, values: Values) -> None:
    span = scene.setting.vehicle.span
    scene.load(lambda r: prandtl(scene.length[:, None] * (span - r), values["spacing"][:, None]))


EFFECT = effect_of_air(
    name="tip_loss",
    title="Tip loss",
    size=(
        Parameter(
            "spacing", "m", 0.0, 2.0, 0.5, "distance between the vortex sheets of successive strokes", of="chord"
        ),
    ),
    law="F = (2 / pi) arccos exp(-pi (R - r) / spacing)",
    source="Prandtl in Betz (1919); Glauert (1935), Aerodynamic Theory, division L, chapter VII",
    signature="only the outer wing carries less load and bends less, at the phases of large lift",
    confused_with=("induced_inflow", "residual_air", "dynamic_stall"),
    wing=_wing,
    vehicle=_vehicle,
)
