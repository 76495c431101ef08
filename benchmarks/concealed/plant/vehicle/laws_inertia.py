"""Hidden errors of the described size of a vehicle's wings, and of their inertia and the air that they accelerate."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks.concealed.plant.law import Concealed, Law, strength
from benchmarks.concealed.plant.vehicle.flow import Array, Complex, Flow, mass_per_length, mean_chord
from wingfit.records import Vehicle

_NEAR = 2.0  # relative error of the added mass of wings that touch, over that one chord apart


def resized(vehicle: Vehicle, hidden: Concealed) -> Vehicle:
    """The ``vehicle`` with wings of another size than described, of the same mass.

    A longer wing is stretched towards its tip, where it becomes longer by the whole fraction; a broader one is broader
    by a third more than the fraction at the root, and by a third less at the tip.
    """
    longer, broader = strength(hidden, "wing_length_error"), strength(hidden, "wing_chord_error")
    if not longer and not broader:
        return vehicle
    places = [(s, s.r / vehicle.span) for s in vehicle.stations]
    wing = [
        replace(s, r=s.r * (1.0 + longer * part), chord=s.chord * (1.0 + broader * (4.0 - 2.0 * part) / 3.0))
        for s, part in places
    ]
    return replace(vehicle, stations=tuple(wing))


def further_aft(flow: Flow, vehicle: Vehicle, hidden: Concealed) -> Array:
    """Distances [E] (m) by which the wing lies further behind its axis of pitch than described, the same everywhere."""
    return np.full(flow.chord.shape, strength(hidden, "pitch_axis_error") * mean_chord(vehicle))


def moved_air(flow: Flow, vehicle: Vehicle, mass: Array, hidden: Concealed) -> Array:
    """Added mass [n, E] (kg/m) across the chord with its hidden changes, for that of the nominal model, ``mass``.

    While wings peel apart, the part (1 - x) of the added mass is missing, with x the flap angle since the start of the
    beat over that at the end of the peel. The relative error of added mass falls as the gap g to the other wing grows,
    2 strength / (1 + g / c) with the chord c (Sedov 1965: plates near each other).
    """
    whole = np.pi / 4 * flow.rho * flow.chord**2
    share = strength(hidden, "effective_chord")
    if share and vehicle.claps:
        mass = np.maximum(mass - share * whole * (1.0 - _opened(flow, vehicle))[:, None], 0.0)
    error = strength(hidden, "added_mass_error")
    if error:
        gap = 2.0 * flow.r * np.sin(flow.zeta - flow.zeta.min())[:, None]
        mass = mass * np.maximum(1.0 + _NEAR * error / (1.0 + gap / flow.chord), 0.0)
    return np.asarray(mass)


def _opened(flow: Flow, vehicle: Vehicle) -> Array:
    """Flap angle since the start of the beat over that at the end of the peel [n], 0 to 1."""
    end = float(np.interp(vehicle.motion.peel_end, flow.t, flow.zeta))
    x = np.where(flow.t < vehicle.motion.peel_end, (flow.zeta - flow.zeta[0]) / (end - flow.zeta[0]), 1.0)
    x[0] = 0.5  # the mean of both sides of the jump
    return np.clip(x, 0.0, 1.0)


def wing_inertia(flow: Flow, own: Complex, vehicle: Vehicle, hidden: Concealed) -> Complex:
    """Inertial force (N/m of span) [n, E], complex, in axes of the chord, that the nominal model does not have.

    With ``own`` [n, E] the velocity of the wing in these axes, and in rotating axes -m dv/dt (Armanini et al. 2016 have
    the other part, Eqs. 12-14). Mass that lies behind the axis of pitch, by the same fraction of every chord, adds
    m e (i theta'' - theta'^2), with ``strength`` the mean of the distance e.
    """
    mass, force = wing_mass(flow, vehicle, hidden), np.zeros(own.shape, complex)
    part = strength(hidden, "wing_acceleration")
    if part:
        force -= part * mass * (flow.turned(flow.own_rate) - 1j * flow.turn * own)
    behind = strength(hidden, "mass_offset")
    if behind:
        arm = behind * flow.chord / mean_chord(vehicle)
        force += mass * arm * (1j * flow.turn_rate - flow.turn**2)
    return force


def wing_mass(flow: Flow, vehicle: Vehicle, hidden: Concealed) -> Array:
    """Mass of a wing per length of span [E], kg/m, with a hidden error: that part of its mass, as chord squared."""
    mass = mass_per_length(flow, vehicle)
    error = strength(hidden, "wing_mass_error")
    return np.asarray(mass * (1.0 + error * flow.chord / (np.sum(flow.chord**2) / np.sum(flow.chord))))


_listed = partial(Law, side="physics")
INERTIA = (
    _listed(
        "inertial",
        typical=1.0,
        source="Armanini et al. (2016), Eqs. 12-14",
        values=lambda p: {"inertial.share": p["strength"]},
    ),
    _listed(
        "wing_acceleration",
        typical=1.0,
        source="Newton (1687): the part of the acceleration that Armanini et al. (2016), Eqs. 12-14, omit",
        values=lambda p: {"wing_acceleration.share": p["strength"]},
    ),
    _listed(
        "added_mass",
        typical=1.0,
        source="Armanini et al. (2016), Eqs. 9-10",
        values=lambda p: {"added_mass.k": p["strength"]},
    ),
    _listed(
        "added_mass_error",
        typical=0.2,
        source="Sedov (1965): plates near each other; largest where the wings are near",
        both_signs=True,
    ),
    _listed(
        "wing_mass_error",
        typical=0.2,
        source="Armanini et al. (2016), Eqs. 12-14: wings that were weighed wrongly, thicker at the root",
        both_signs=True,
        values=lambda p: {"wing_mass_error.part": p["strength"]},
    ),
    _listed(
        "wing_length_error",
        typical=0.05,
        source="Armanini et al. (2016), Eqs. 1 and 18: the outer part of a wing that is longer than it was measured",
        both_signs=True,
    ),
    _listed(
        "wing_chord_error",
        typical=0.1,
        source="Armanini et al. (2016), Eqs. 2, 3, 10 and 11: an outline that is wrong, most at the root",
        both_signs=True,
    ),
    _listed(
        "pitch_axis_error",
        typical=0.05,
        source="Sedov (1965): the air meets a plate that turns about an axis further ahead at other velocities",
        both_signs=True,
    ),
    _listed(
        "effective_chord",
        typical=1.0,
        source="added mass in proportion to the opening angle, not to the square of time",
        values=lambda p: {"effective_chord.share": min(p["strength"], 1.0)},
    ),
    _listed(
        "mass_offset",
        typical=4e-3,
        source="Newton (1687): centre of mass at the same fraction of every chord, not at the same distance",
        both_signs=True,
        values=lambda p: {"mass_offset.distance": p["strength"]},
    ),
)
