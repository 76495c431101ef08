"""Bodies, connectors and sparsity pattern of a discretised wing: everything that does not depend on genes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from wingfit.records import Rod, Wing
from wingfit.records.array_types import Array
from wingfit.sim.kernels.arrays import Wiring
from wingfit.sim.solver.elimination import eliminate
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.planform import Body, Panel, Planform, bodies, marker_carriers
from wingfit.sim.wing.sections import Rectangle, round_area, round_second_moment

# Rows of Connector.foam and .rods: rotation about x, y, z, then translation along x, y, z, each a rigidity per modulus.
# The foam modulus of each row, for connections along the span (y) and along the chord (x): thesis Eqs. 15-17.
YOUNG, SHEAR = 0, 1
SPANWISE_MODULUS = (YOUNG, SHEAR, YOUNG, SHEAR, YOUNG, SHEAR)
CHORDWISE_MODULUS = (SHEAR, YOUNG, YOUNG, YOUNG, SHEAR, SHEAR)
QUARTERS = 4  # parts of the chord, each with a gene for its share of the lift and one for that of induced drag
_DRIVEN_GAP = 0.02  # m, largest distance between the root and the start of a driven rod


@dataclass(frozen=True)
class Connector:
    """Spring and damper between two bodies, or between a driving rod and a body.

    Stiffness = modulus times (second moment or area) / (distance between the bodies' centroids), thesis Eqs. 15-16. The
    six entries of a stiffness are rotations about x, y, z, then translations along x, y, z.

    Attributes:
        first, second: indices of the bodies; ``first`` is -1 for the front driving rod and -2 for the rear one.
        point: [3] position at rest, wing frame, m.
        foam: [6] second moments (m^4) and areas (m^2) of the foam, divided by the distance.
        parts: [S] lengths of S parts of the distance, as fractions of it, from its inner end: rods end between parts.
        rods: [S, 6] as ``foam``, of the rods in each part.
        modulus: for each of the six, whether Young's (0) or the shear modulus (1) of the foam applies.
    """

    first: int
    second: int
    point: Array
    foam: Array
    parts: Array
    rods: Array
    modulus: tuple[int, ...]


def spring_constants(connectors: tuple[Connector, ...], foam: Array, rod: Array) -> Array:
    """Stiffness [C, 6, W] in N m/rad and N/m of C ``connectors`` for W individuals.

    ``foam``, ``rod`` [2, W]: Young's and shear modulus of each material, Pa. Thesis Eqs. 15-16 give the stiffness of
    each part of the distance that a connector spans. The parts are in series, so that their compliances add. A mean
    stiffness instead would overestimate a rod that ends between the bodies, and converge with the first order only
    (docs/beams.md).
    """
    beside = np.array([c.foam for c in connectors])[:, :, None] * foam[np.array([c.modulus for c in connectors])]
    modulus = np.repeat(rod, 3, axis=0)
    compliance = np.zeros_like(beside)
    with np.errstate(divide="ignore"):  # without foam and rod there is no spring
        for k in range(len(connectors[0].parts)):
            part = np.array([c.parts[k] for c in connectors])[:, None, None]
            stiffness = beside + np.array([c.rods[k] for c in connectors])[:, :, None] * modulus
            compliance += np.divide(part, stiffness, out=np.zeros_like(stiffness), where=part > 0)
        return np.asarray(1 / compliance)


@dataclass(frozen=True)
class Structure:
    """A discretised wing.

    Attributes:
        panels, bodies: geometry and mass properties of the rigid bodies, in the same order.
        connectors: springs and dampers between them.
        wiring: the same as inputs of the kernels.
        position: index of the block in the solver's matrix for a pair (row, column) of bodies.
    """

    wing: Wing
    division: Division
    planform: Planform
    panels: tuple[Panel, ...]
    bodies: tuple[Body, ...]
    connectors: tuple[Connector, ...]
    wiring: Wiring
    position: dict[tuple[int, int], int]

    @cached_property
    def stretches(self) -> tuple[tuple[int, int, float, float], ...]:
        """Overlaps of bodies with quarters of the chord; they distribute air forces, which are given for each quarter.

        Each entry: index of the body, of the quarter (0 at the leading edge), overlap as a fraction of the chord, and x
        (m) of the middle of the overlap in the body's frame.
        """
        edges = np.linspace(0, 1, QUARTERS + 1).tolist()
        return tuple(
            (n, q, s1 - s0, self.planform.x(0.5 * (s0 + s1), 0.5 * (panel.y0 + panel.y1)) - self.bodies[n].centre[0])
            for n, panel in enumerate(self.panels)
            for q, (low, high) in enumerate(pairwise(edges))
            if (s1 := min(panel.s1, high)) > (s0 := max(panel.s0, low))
        )


def build(wing: Wing, division: Division, *, whole_strips: bool = False) -> Structure:
    """Discretise ``wing`` into the bodies of ``division``; ValueError if a driven rod does not reach the root.

    With ``whole_strips`` the solver's matrix has blocks for all pairs of bodies of a strip, which added mass couples.
    """
    planform = Planform(wing)
    panels = planform.panels(division)
    parts = bodies(planform, panels)
    connectors = [
        *_along_span(planform, division, parts),
        *_along_chord(planform, division, panels, parts),
        *_at_root(planform, division, parts),
    ]
    wiring, position = _wiring(planform, division, panels, parts, connectors, whole_strips)
    return Structure(wing, division, planform, tuple(panels), tuple(parts), tuple(connectors), wiring, position)


def _twisting(planform: Planform, y: float) -> float:
    """Torsion constant of the whole chord at span position ``y`` (m), per width (m^3), whatever its discretisation."""
    chord = float(planform.chord(y))
    return Rectangle(chord, float(planform.thickness(y))).torsion / chord


def _spanwise_share(count: int) -> float:
    """Fraction of the torsion constant that spanwise connectors have, for ``count`` bodies along the chord.

    Half of the torque of a section is due to shear along it, half to shear across it. Chordwise connectors carry the
    second half, but exist at only (count - 1) / count of the chord. Spanwise ones carry the rest: the whole torque if
    count is 1.
    """
    return 0.5 * (1 + 1 / count)


def _rigidities(section: Rectangle, torsion: float, along_span: bool) -> Array:
    A = section.area
    if along_span:
        return np.array([section.flapwise, torsion, section.inplane, A, A, A])
    return np.array([torsion, section.flapwise, section.inplane, A, A, A])


def _rod_rigidities(diameter: float) -> Array:
    """I_r about x, y, z (m^4), then A_r along x, y, z (m^2), [6], of thesis Eqs. 15-16 for a rod of ``diameter`` (m).

    I_r is the second moment and A_r the area of the round section. About and along the span they are replaced by 0,
    since rods can turn and slide in their straws.
    """
    second, A = round_second_moment(diameter), round_area(diameter)
    return np.array([second, 0.0, second, A, 0.0, A])


def _x_of(rod: Rod, y: float) -> float:
    """x (m) of the rod at span position ``y`` (m)."""
    return rod.x_root + (y - rod.y_root) / (rod.y_tip - rod.y_root) * (rod.x_tip - rod.x_root)


def _piece(planform: Planform, rod: Rod, y: float, count: int) -> int:
    """Index of the piece that contains the rod at ``y``, if the chord is divided into ``count`` equal pieces."""
    return min(int(planform.fraction(_x_of(rod, y), y) * count), count - 1)


def _rod_parts(planform: Planform, through: list[Rod], y0: float, y1: float) -> tuple[Array, Array]:
    """``parts`` and ``rods`` of a :class:`Connector` for the rods ``through`` it, between span positions y0 and y1 (m).

    Parts end wherever any rod of the wing ends, so that every connector has the same number of parts.
    """
    ends = [end for rod in planform.wing.rods for end in (rod.y_root, rod.y_tip)]
    ends_between = np.sort(np.clip([y0, *ends, y1], y0, y1))
    middle = 0.5 * (ends_between[1:] + ends_between[:-1])
    rods = np.zeros((len(middle), 6))
    for rod in through:
        rods += np.outer((rod.y_root <= middle) & (middle <= rod.y_tip), _rod_rigidities(rod.diameter))
    return np.diff(ends_between) / (y1 - y0), rods / (y1 - y0)


def _through(
    planform: Planform, division: Division, strip: int, y0: float, y1: float
) -> dict[tuple[int, int], list[Rod]]:
    """Rods between the centroids y0 of ``strip`` and y1 of the next strip (m), by the pair of bodies that they connect.

    The pair consists of the bodies that contain the rod at y0 and at y1: they remain connected where a rod passes from
    one piece of the chord to another. A rod that ends or begins in between is assigned to bodies at the same fraction
    of the chord.
    """
    found: dict[tuple[int, int], list[Rod]] = {}
    for rod in planform.wing.rods:
        start, end = max(rod.y_root, y0), min(rod.y_tip, y1)
        if end <= start:
            continue
        inner = _piece(planform, rod, start if start == y0 else end, division.bodies[strip])
        outer = _piece(planform, rod, end if end == y1 else start, division.bodies[strip + 1])
        pair = division.index(strip, inner), division.index(strip + 1, outer)
        found.setdefault(pair, []).append(rod)
    return found


def _along_span(planform: Planform, division: Division, parts: list[Body]) -> list[Connector]:
    found = []
    edges = planform.strips(division)
    for strip in range(len(division.bodies) - 1):
        y = float(edges[strip + 1])
        inner, outer = division.bodies[strip], division.bodies[strip + 1]
        y0, y1 = (float(parts[division.index(s, 0)].centroid[1]) for s in (strip, strip + 1))
        through = _through(planform, division, strip, y0, y1)
        twisting = _twisting(planform, y) * 0.5 * (_spanwise_share(inner) + _spanwise_share(outer))
        for i, j, s0, s1 in _facing(inner, outer):
            pair = division.index(strip, i), division.index(strip + 1, j)
            section = Rectangle((s1 - s0) * float(planform.chord(y)), float(planform.thickness(y)))
            foam = _rigidities(section, twisting * section.width, True) / (y1 - y0)
            point = np.array([planform.x(0.5 * (s0 + s1), y), y, 0.0])
            rods = _rod_parts(planform, through.pop(pair, []), y0, y1)
            found.append(Connector(*pair, point, foam, *rods, SPANWISE_MODULUS))
        for pair, rods_alone in through.items():
            point = np.array([np.mean([_x_of(rod, y) for rod in rods_alone]), y, 0.0])
            rods = _rod_parts(planform, rods_alone, y0, y1)
            found.append(Connector(*pair, point, np.zeros(6), *rods, SPANWISE_MODULUS))
    return found


def _facing(inner: int, outer: int) -> list[tuple[int, int, float, float]]:
    """Overlaps of ``inner`` with ``outer`` equal pieces of the chord, on the two sides of an edge between strips.

    Each entry: index of the inner and of the outer piece, chord fractions at which the overlap starts and ends.
    """
    both = [
        (i, j, max(i / inner, j / outer), min((i + 1) / inner, (j + 1) / outer))
        for i in range(inner)
        for j in range(outer)
    ]
    return [touching for touching in both if touching[3] - touching[2] > 1e-9]


def _along_chord(planform: Planform, division: Division, panels: list[Panel], parts: list[Body]) -> list[Connector]:
    found = []
    for strip, count in enumerate(division.bodies):
        for k in range(count - 1):
            first, second = division.index(strip, k), division.index(strip, k + 1)
            panel = panels[first]
            y = 0.5 * (panel.y0 + panel.y1)
            length = parts[second].centroid[0] - parts[first].centroid[0]
            section = Rectangle(panel.y1 - panel.y0, float(planform.thickness(y)))
            foam = _rigidities(section, 0.5 * _twisting(planform, y) * section.width, False) / length
            point = np.array([planform.x(panel.s1, y), y, 0.0])
            rods = _rod_parts(planform, [], panel.y0, panel.y1)
            found.append(Connector(first, second, point, foam, *rods, CHORDWISE_MODULUS))
    return found


def _at_root(planform: Planform, division: Division, parts: list[Body]) -> list[Connector]:
    """Connectors between the driving rods and the bodies at the root.

    Driven rods in the same body share its foam equally. A driven rod that starts outboard of the root is extended to
    it, since it continues into its drive. ValueError if it starts too far outboard.
    """
    wing, count = planform.wing, division.bodies[0]
    y, y1 = wing.stations[0].y, float(parts[0].centroid[1])
    entries = []
    if wing.structure is not None:
        return _clamped_root(planform, division, y1)
    for name in wing.driven_rods:
        rod = next(r for r in wing.rods if r.name == name)
        if not (rod.y_root <= y + _DRIVEN_GAP and rod.y_tip >= y):
            raise ValueError(
                f"driven rod {name!r} lies from y = {rod.y_root:g} m to {rod.y_tip:g} m; to drive the wing it must "
                f"start at most {_DRIVEN_GAP:g} m outboard of the root at {y:g} m and end beyond it: extend the rod"
            )
        entries.append((rod, _piece(planform, rod, min(y1, rod.y_tip), count)))
    found = []
    for number, (rod, body) in enumerate(entries):
        sharing = sum(other == body for _, other in entries)
        section = Rectangle(float(planform.chord(y)) / count, float(planform.thickness(y)))
        torsion = _twisting(planform, y) * section.width * _spanwise_share(count)
        foam = _rigidities(section, torsion, True) / (y1 - y) / sharing
        point = np.array([_x_of(rod, max(y, rod.y_root)), y, 0.0])
        rods = _rod_parts(planform, [replace(rod, y_root=min(y, rod.y_root))], y, y1)
        found.append(Connector(-1 - number, body, point, foam, *rods, SPANWISE_MODULUS))
    return found


def _clamped_root(planform: Planform, division: Division, y1: float) -> list[Connector]:
    """Connectors between the drive and the bodies at the root of a wing without rods; y1 (m): centroids of the bodies.

    Each body at the root is held at the middle of its root chord; a single one at a quarter and three quarters of it.
    The front half is counted as held by the front driving rod, the rear half by the rear one, which moves alike.
    """
    y, count = planform.wing.stations[0].y, division.bodies[0]
    held = [(0, 0.25), (0, 0.75)] if count == 1 else [(k, (k + 0.5) / count) for k in range(count)]
    section = Rectangle(float(planform.chord(y)) / len(held), float(planform.thickness(y)))
    torsion = _twisting(planform, y) * section.width * _spanwise_share(count)
    foam = _rigidities(section, torsion, True) / (y1 - y)
    rods = _rod_parts(planform, [], y, y1)
    return [
        Connector(-1 if fraction < 0.5 else -2, body, np.array([planform.x(fraction, y), y, 0.0]), foam, *rods,
                  SPANWISE_MODULUS)
        for body, fraction in held
    ]  # fmt: skip


def _wiring(
    planform: Planform,
    division: Division,
    panels: list[Panel],
    parts: list[Body],
    connectors: list[Connector],
    whole_strips: bool,
) -> tuple[Wiring, dict[tuple[int, int], int]]:
    n = len(parts)
    hinge = np.array([0.0, planform.wing.hinge.y, planform.wing.hinge.z])
    first = np.array([c.first if c.first >= 0 else n - 1 - c.first for c in connectors], np.int64)
    second = np.array([c.second for c in connectors], np.int64)
    base = [c.point - (parts[c.first].centre if c.first >= 0 else hinge) for c in connectors]
    b = np.array([c.point - parts[c.second].centre for c in connectors])
    joined = [(int(i), int(j)) for i, j in zip(first, second, strict=True) if i < n]
    if len(set(joined)) < len(joined):
        raise AssertionError("two connectors between the same bodies: their blocks would overwrite each other")
    starts = np.concatenate([[0], np.cumsum(division.bodies)]).astype(np.int64)
    beside = {
        (i, j) for k in range(len(starts) - 1) for j in range(starts[k], starts[k + 1]) for i in range(starts[k], j)
    }
    work = eliminate(n, set(joined), beside if whole_strips else set())
    outer, last = len(first) - len(joined), n + 2 * len(work.below)
    area = np.array([part.area for part in parts])
    strip_area = np.add.reduceat(area, starts[:-1])
    markers = planform.wing.markers
    carriers = marker_carriers(planform, panels, markers)
    lower = [*(work.position[j, i] for i, j in joined), *range(last, last + outer)]
    upper = [*(work.position[i, j] for i, j in joined), *[-1] * outer]
    wiring = Wiring(
        mass=np.array([part.mass for part in parts]), inertia=np.array([part.inertia.ravel() for part in parts]),
        first=first, second=second, lower=np.array(lower, np.int64), upper=np.array(upper, np.int64),
        driven=int(np.argmax(first >= n)), a=np.array(base), b=b,
        order=work.order, start=work.start, below=work.below, row=work.row,
        products=work.products, product_start=work.product_start, fill=work.fill,
        strip_start=starts, weight=area / np.repeat(strip_area, division.bodies),
        centroid=np.array([(part.centroid - part.centre)[:2] for part in parts]),
        geometry=_geometry(planform, division, strip_area), carrier=carriers,
        markers=np.array([np.array(m.position) - parts[k].centre for m, k in zip(markers, carriers, strict=True)]),
    )  # fmt: skip
    return wiring, work.position


def _geometry(planform: Planform, division: Division, area: Array) -> Array:
    """Area (m^2), mean chord (m), width (m) and span fraction of the middle of each strip, [S, 4].

    ``area`` [S]: areas of the strips, m^2.
    """
    edges = planform.strips(division)
    width = np.diff(edges)
    station = (0.5 * (edges[1:] + edges[:-1]) - edges[0]) / (edges[-1] - edges[0])
    return np.stack([area, area / width, width, station], axis=1)
