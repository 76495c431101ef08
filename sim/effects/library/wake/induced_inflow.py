"""Effect: the wings push air through the disc that they sweep, and move through the stream this causes (inflow)."""

from __future__ import annotations

from typing import Any

import numpy as np

from wingfit.sim.effects.contract import Array, Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene, deferred
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels.arrays import AREA, CHORD_X, CIRCULATION, NORMAL_X, STREAM_C, STREAM_N
from wingfit.sim.kernels.lanes.vector import load, load1, root, store
from wingfit.sim.kernels.laws import BEFORE, strip_port
from wingfit.sim.vehicle.states import settled_inflow

_STILL = 1e-12  # m^2/s^2, keeps the mass flow differentiable in still air
_TRIANGLE = 1.5  # inflow at the tip over its mean over the disc, where it is proportional to the radius
_SCALE = 0.1  # motion of the wing over the motion of the air that causes it


def apparent_mass(density: Array, area: Array) -> Array:
    """Return the air mass (kg) that a disc moves: 8/3 rho R^3 for radius R (Tuckerman 1925; Pitt and Peters 1981)."""
    return np.asarray(8.0 / 3.0 * density * (area / np.pi) ** 1.5)


def swept_area(span: float | Array, stroke: Array, wings: int) -> Array:
    """Return the area (m^2) that ``wings`` of ``span`` (m) sweep by a ``stroke`` (rad) in all (Ellington 1984, III)."""
    return np.asarray(span**2 * np.minimum(0.5 * wings * stroke, np.pi))


def _induce(scene: VehicleScene, values: Values) -> None:
    """Add the periodic inflow along body x, through the disc that the vehicle's wings sweep, to the scene.

    Its mean v over the disc solves m v' + 2 rho A V_T v = share T(v), V_T^2 = (U_x + mean v)^2 + U_z^2, with the air's
    apparent mass m and density rho, the disc's area A, the stream (U_x, U_z), the thrust T of the wings, and the
    effect's size share. T is taken as linear in v between zero and the inflow of hover, then once more about the
    solution. v is computed at every second instant, because it is smooth. Its rate of change is neglected in the force
    of added mass.
    """
    vehicle, wings = scene.setting.vehicle, scene.wings.every(2)
    flap, share = scene.angles.flap[:, 0], values["share"][:, None]
    area = swept_area(scene.span, flap.max(axis=1) - flap.min(axis=1), vehicle.wings)
    flux, mass = 2.0 * scene.density * area, apparent_mass(scene.density, area) * values["inertia"]
    stream = scene.airspeed[:, None] * np.stack([np.cos(scene.incidence), np.sin(scene.incidence)], axis=1)
    met = scene.forward(scene.inflow)[:, ::2]

    same, outward = 1.0 - values["outward"][:, None], values["outward"][:, None] * _TRIANGLE
    x = wings.places.r / vehicle.span

    def thrust(inflow: Array) -> Array:
        flow = wings.flow(met + same * inflow)
        wings.blow(flow, (outward * inflow)[:, :, None] * x)
        return share * wings.forces(flow)[:, 0]

    still = thrust(np.zeros((len(scene), 1)))
    mean = still.mean(axis=1)
    # never zero: the slope is a difference over it
    hover = np.copysign(np.sqrt(np.abs(mean) / np.maximum(flux, 1e-12)) + 1e-3, mean)[:, None]
    slope, inflow = (still - thrust(hover)) / hover, np.empty_like(still)
    settled_inflow(still, slope, flux, mass, stream, 2.0 * scene.step, inflow)
    settled_inflow(thrust(inflow) + slope * inflow, slope, flux, mass, stream, 2.0 * scene.step, inflow)
    between = 0.5 * (inflow + np.roll(inflow, -1, axis=1))
    v = np.stack([inflow, between], axis=2).reshape(scene.inflow.shape)
    scene.inflow = scene.inflow + same * v
    scene.after("wake", lambda: _blow(scene, (outward * v)[:, :, None] * x))


def _blow(scene: VehicleScene, air: Array) -> None:
    scene.wings.blow(scene.flow, air)
    scene.carry(air)


def slices(edges: Array) -> Array:
    """Return the areas (m^2) that strips between the ``edges`` cut from a disc whose radius is the last edge.

    ``edges`` [S + 1] of S strips: m from the disc's centre. If the load is elliptic, the inflow is the same at all
    strips, as on a lifting line (Prandtl 1918; Glauert 1926).
    """
    x, tip = edges / edges[-1], edges[-1]
    return np.asarray(tip**2 * np.diff(x * np.sqrt(1.0 - x**2) + np.arcsin(x)))


def _law(frame: Any, moment: int) -> None:
    """Add the inflow v of each strip to the air: v' = -share L / m - 2 rho A |U + v| v / m in world axes.

    v (m/s) is the state of the strip, share the effect's size, L the strip's lift (N, a vector), U the wind, A and m
    the area and the air mass of the strip's slice of the disc (:func:`slices`). ``frame`` and ``moment``: see
    :mod:`wingfit.sim.kernels.laws`.
    """
    port = strip_port(frame)
    for s in range(port.places):
        if moment == BEFORE:
            for i in range(3):
                store(port.induced, s, i, load(port.induced, s, i) + load(port.state, i, s))
            continue
        pushed = load(port.parameters, 0, s) * load(port.loads, s, CIRCULATION)
        along, across = pushed * load(port.flow, s, STREAM_C), pushed * load(port.flow, s, STREAM_N)
        square = pushed * 0.0 + _STILL
        for i in range(3):
            through = load1(port.wind, i) + load(port.state, i, s)
            square += through * through
        through = root(square)
        washed = load(port.parameters, 1, s)
        for i in range(3):
            v = load(port.state, i, s)
            lift = along * load(port.flow, s, NORMAL_X + i) - across * load(port.flow, s, CHORD_X + i)
            store(port.rate, i, s, -lift - washed * through * v)
            more = v * (load1(port.wind, i) + v) / through
            store(port.decay, i, s, washed * (through + more))


def _wing(scene: WingScene, values: Values) -> None:
    """Let a wing induce inflow through the disc whose diameter is the span of the wing and its mirror image."""
    structure = scene.structure
    edges = structure.planform.strips(structure.division)
    depth = apparent_mass(np.array(1.0), np.array(np.pi * edges[-1] ** 2)) / (np.pi * edges[-1] ** 2)
    mass = depth * values["inertia"]  # over density and area
    area = structure.wiring.geometry[:, AREA] / slices(edges)
    parameters = [0.5 * area[:, None] * values["share"] / mass, 2.0 / mass]
    scene.add_strip_law(_law, parameters, states=[_SCALE / scene.angular_rate] * 3, before=True)


EFFECT = effect_of_air(
    name="induced_inflow",
    title="Induced inflow",
    size=(
        Parameter(
            "share", "1", 0.0, 4.0, 0.5, "thrust (vehicle) or lift (wing) that drives the inflow, over all of it"
        ),
    ),
    shape=(
        Parameter(
            "inertia", "1", 0.1, 3.0, 1.0, "mass of the accelerated air over the apparent mass of a disc", scale="log"
        ),
        Parameter(
            "outward",
            "1",
            0.0,
            1.0,
            0.5,
            "how far the inflow grows with the radius; 0: uniform, 1: in proportion to it",
            vehicle_only=True,
        ),
    ),
    memory="on a vehicle the mean inflow through the swept disc; on a wing in a tunnel the inflow of each strip",
    law="m v' + 2 rho A V_T v = share T(v)             vehicle\n"
    "v(r) = v (1 - outward + outward 3 r / (2 R))  vehicle\n"
    "m v' = -share L - 2 rho A |U + v| v           each strip of a wing",
    source="Glauert (1926): momentum theory; Pitt and Peters (1981), Vertica 5, 21: apparent mass of the air; Leishman "
    "(2006), section 3.3: inflow over the radius",
    signature="the mean force is smaller, most in hover and least in fast flight",
    confused_with=("tip_loss", "airspeed_error", "residual_air"),
    wing=_wing,
    vehicle=deferred("inflow", _induce),
)
