"""Simulates one beat of the periodic motion of a wing as a continuous rod, with hidden effects.

The wing is what the bodies and springs of :mod:`benchmarks.concealed.plant.wing` become with ever more strips of one
body along the chord, but the discretisation in space and time and the equations are others: a geometrically exact rod
(Reissner 1972; Simo and Vu-Quoc 1986) in quadratic finite elements, with consistent mass. Hidden effects have the
parameters and the meaning of :mod:`benchmarks.concealed.plant.wing_effects`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.continuum.beam import Beam
from benchmarks.concealed.plant.continuum.build import Laws, Mesh, beam_of
from benchmarks.concealed.plant.continuum.integrate import new_motion
from benchmarks.concealed.plant.continuum.interpolation import trace_points
from benchmarks.concealed.plant.continuum.periodic import Cycle, Settings, settle
from benchmarks.concealed.plant.continuum.sections import Sections
from benchmarks.concealed.plant.wing.build import Draft
from benchmarks.concealed.plant.wing.rig import MAXWELL, SLIDER
from benchmarks.concealed.plant.wing.simulate import Beat
from benchmarks.concealed.plant.wing_effects.hidden import Effect, Hidden
from wingfit.records import Condition, Wing

Array = npt.NDArray[np.float64]

EFFECTS = (
    "lumped_mass", "damage", "cubic_stiffness", "viscoelastic", "hysteresis", "rod_slip", "stroke_amplitude",
    "stroke_bias", "drive_harmonics", "phase_lag_error", "hinge_tilt", "hinge_offset", "residual_air", "added_mass",
    "leading_edge_vortex", "circulation_lag", "dynamic_stall", "band", "stop", "brake", "appendage", "tooth",
    "closed_cells",
)  # fmt: skip
"""Hidden effects that the rod can have."""


def simulate(
    wing: Wing,
    genome: Mapping[str, float],
    condition: Condition,
    hidden: Hidden | None = None,
    elements: int = 12,
    settings: Settings | None = None,
) -> Beat:
    """Simulate one periodic beat of ``wing``.

    ``genome``: model parameters by name (van der Grinten's thesis, Eqs. 18-19), SI units. ``elements``: about how many
    finite elements along the span; at least one between any two stations or ends of rods. ValueError for an effect that
    is not in EFFECTS, ArithmeticError if there is no periodic motion.
    """
    concealed = hidden or Hidden()
    draft = _drafted(wing, genome, condition, concealed)
    sections = Sections(wing, genome, float(draft.factor[0]), _notches(wing, concealed))
    mesh = Mesh(sections, elements)
    beam = beam_of(sections, mesh, draft.condition, _laws(draft))
    cycle = settle(beam, draft.rods, settings or Settings())
    places = np.array([marker.position for marker in wing.markers])
    turns = {e.name: _middle(draft, e, cycle, sections, mesh) for e in concealed.effects if e.kind.acting}
    return Beat(wing, _tracks(cycle, sections, mesh, places), concealed, turns, cycle.error, cycle.beats)


def _drafted(wing: Wing, genome: Mapping[str, float], condition: Condition, hidden: Hidden) -> Draft:
    """A draft, of two bodies, with all effects but damage: whatever does not depend on bodies is taken from it."""
    for effect in hidden.effects:
        if effect.kind.name not in EFFECTS:
            raise ValueError(f"the rod cannot hide {effect.name!r}; it can hide {', '.join(EFFECTS)}")
    draft = Draft(wing, "2x1", genome, condition)
    Hidden(tuple(effect for effect in hidden.effects if effect.name != "damage")).put_into(draft)
    return draft


def _laws(draft: Draft) -> Laws:
    """What acts on the rod by ``draft``; joint 0 is the one between its two bodies."""
    centres = draft.cut.bodies[1]
    points = [(centres[body] + np.array(row[1:4]), np.array(row)) for body, row in draft.points]
    steep = float(draft.hardening.max()) * draft.span
    joint, memory = draft.joints[0], list[tuple[int, int, float, float]]()
    for c, axis, kind, stiffness, parameter in draft.memory:
        if c == 0:
            whole = joint.of_rods if int(kind) == SLIDER else float(joint.stiffness[axis])
            limit = parameter if int(kind) == MAXWELL else parameter / joint.length
            memory.append((axis, int(kind), stiffness / whole, limit))
    return Laws(steep, draft.air_laws, draft.hinge, draft.axle, draft.lumps, memory, points, draft.rods)


def _notches(wing: Wing, hidden: Hidden) -> list[tuple[float, float, float]]:
    """Where damage reduces the rigidity: (from, to, fraction), span positions in m."""
    root, span, found = wing.stations[0].y, wing.stations[-1].y - wing.stations[0].y, []
    for effect in hidden.effects:
        if effect.name == "damage" and effect.strength != 0.0:
            at = effect.values
            start, end = (root + span * (at["span"] + side * 0.5 * at["width"]) for side in (-1, 1))
            found.append((start, end, effect.strength))
    return found


def _tracks(cycle: Cycle, sections: Sections, mesh: Mesh, places: Array) -> Array:
    """[n, M, 3] positions (m) over the ``cycle`` of the points that are at ``places`` [M, 3] at rest."""
    arms = [sections.arm(place) for place in places]
    element, part = mesh.locate(np.array([y for y, _ in arms]))
    out = np.empty((len(cycle.p), len(places), 3))
    offsets = np.array([arm for _, arm in arms])
    trace_points(cycle.R, cycle.p, element, part, offsets, new_motion(cycle.p.shape[1]), out)
    return out


def _middle(draft: Draft, effect: Effect, cycle: Cycle, sections: Sections, mesh: Mesh) -> float:
    """Drive phase (rad) at which an effect acts: circular mean weighted by magnitudes above half the maximum."""
    if effect.kind.acting is None:
        raise ValueError(f"{effect.name} has no phase that the motion determines")
    place = draft.at(effect.values["span"], effect.values["chord"])[2]
    height = _tracks(cycle, sections, mesh, place[None])[:, 0, 2]
    rate = np.gradient(np.concatenate([height[-1:], height, height[:1]]))[1:-1] * len(height)
    size = effect.kind.acting(draft, effect.values, height, rate * draft.condition.flap_frequency)
    turn = np.exp(2j * np.pi * np.arange(len(size)) / len(size))
    return float(np.angle((np.where(size > 0.5 * size.max(), size, 0.0) * turn).sum()) % (2 * np.pi))


def beam(wing: Wing, genome: Mapping[str, float], condition: Condition, elements: int = 12) -> Beam:
    """Arrays of ``wing`` as a rod without hidden effects; arguments as for :func:`simulate`."""
    sections = Sections(wing, genome)
    return beam_of(sections, Mesh(sections, elements), condition, _laws(_drafted(wing, genome, condition, Hidden())))
