"""Effect: the wings turn about another axis, along the chord, than described."""

from __future__ import annotations

import numpy as np

from wingfit.records.array_types import Array
from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.vehicle import VehicleScene


def _vehicle(scene: VehicleScene, values: Values) -> None:
    """Change the circulation by rotation, and the place of the air that is accelerated."""
    scene.behind = scene.behind + values["chords"]
    scene.after("mass", lambda: _push_air(scene, values["chords"]))


def _push_air(scene: VehicleScene, chords: Array) -> None:
    """Add the forces on the added mass, which lies so many ``chords`` [B] further behind the axis.

    That by the rate of pitch is a part of the forces of a turning wing (Eqs. 12-14), the other of those of added mass.
    """
    rows, _ = scene.wings.sides[0]
    air = chords * 0.25 * np.pi * scene.carried * scene.density
    moment = (air[:, None] * scene.apart(rows) ** 2)[:, :, None] * scene.chords[:, None] ** 3
    scene.push_behind(scene.share("added_mass") * moment, scene.share("inertial") * moment)


EFFECT = Effect(
    name="pitch_axis_error",
    title="Error of the axis of pitch",
    family="aerodynamics",
    port="inertia",
    size=(
        Parameter(
            "chords", "1", -0.4, 0.4, 0.05, "distance in chords by which the axis lies ahead of its described place"
        ),
    ),
    law="V_z' = V_z - chords c theta_w'",
    source="Sedov (1965), Two-Dimensional Problems in Hydrodynamics and Aerodynamics: a plate that turns about another "
    "point; Armanini et al. (2016), Eqs. 2 and 9",
    signature="a force in phase with the acceleration and the square of the rate of pitch, in proportion to the "
    "density of the air",
    confused_with=("mass_offset", "clock_offset", "filter_delay", "wing_pitch_phase"),
    of_term="added_mass",
    vehicle=_vehicle,
)
