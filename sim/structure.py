"""From a wing and a division to bodies, connectors and the matrix structure: everything that no gene changes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from records import Wing
from sim.division import Division
from sim.kernels.integrate import Wiring
from sim.planform import Body, Panel, Planform, bodies, marker_carriers, rod_at
from sim.sections import Rectangle, round_area, round_second_moment

Array = npt.NDArray[np.float64]

# Rows of Connector.foam and .rod: rotation about x, y, z, then translation along x, y, z, each a rigidity per modulus.
# Which foam modulus governs each row, for a connection along the span (y) and along the chord (x): thesis Eqs. 15-17.
YOUNG, SHEAR = 0, 1
SPANWISE_MODULUS = (YOUNG, SHEAR, YOUNG, SHEAR, YOUNG, SHEAR)
CHORDWISE_MODULUS = (SHEAR, YOUNG, YOUNG, YOUNG, SHEAR, SHEAR)


@dataclass(frozen=True)
class Connector:
    """Spring and damper between two bodies at ``point`` (wing frame); ``first`` is -1 or -2 for a driving rod.

    ``foam`` [6] and ``rod`` [6] are second moments (m^4) and areas (m^2) divided by the distance between the bodies'
    centres; times the modulus named by ``modulus`` they are stiffnesses (thesis Eqs. 15-16 with the length put in).
    """

    first: int
    second: int
    point: Array
    foam: Array
    rod: Array
    modulus: tuple[int, ...]


@dataclass(frozen=True)
class Structure:
    """A wing cut into bodies."""

    wing: Wing
    division: Division
    planform: Planform
    panels: tuple[Panel, ...]
    bodies: tuple[Body, ...]
    connectors: tuple[Connector, ...]
    wiring: Wiring


def build(wing: Wing, division: Division) -> Structure:
    """Cut ``wing``; ValueError when a driven rod does not reach the root."""
    planform = Planform(wing)
    panels = planform.panels(division)
    parts = bodies(planform, panels)
    connectors = [
        *_along_span(planform, division, parts),
        *_along_chord(planform, division, panels, parts),
        *_at_root(planform, division, panels, parts),
    ]
    wiring = _wiring(planform, division, panels, parts, connectors)
    return Structure(wing, division, planform, tuple(panels), tuple(parts), tuple(connectors), wiring)


def _grillage(count: int) -> float:
    """Share of the torsion constant that spanwise connectors carry.

    In a plate cut both ways, spanwise and chordwise connectors twist together; each carries half where both exist. With
    one body along the chord the spanwise connector carries all. Chordwise connectors exist at (n - 1)/n of the chord.
    """
    return 0.5 * (1 + 1 / count)


def _rigidities(section: Rectangle, torsion_share: float, along_span: bool) -> Array:
    torsion = section.torsion * torsion_share
    A = section.area
    if along_span:
        return np.array([section.flapwise, torsion, section.inplane, A, A, A])
    return np.array([torsion, section.flapwise, section.inplane, A, A, A])


def _rod_rigidities(diameter: float) -> Array:
    """Per modulus: E_r I_r about x and z, G_r A_r along x and z; nothing along or about the span: the rod slides."""
    second, A = round_second_moment(diameter), round_area(diameter)
    return np.array([second, 0.0, second, A, 0.0, A])


def _along_span(planform: Planform, division: Division, parts: list[Body]) -> list[Connector]:
    found = []
    edges = planform.strips(division)
    for strip in range(len(division.bodies) - 1):
        y = float(edges[strip + 1])
        inner, outer = division.bodies[strip], division.bodies[strip + 1]
        for i in range(inner):
            for j in range(outer):
                s0, s1 = max(i / inner, j / outer), min((i + 1) / inner, (j + 1) / outer)
                if s1 - s0 < 1e-9:
                    continue
                first, second = division.index(strip, i), division.index(strip + 1, j)
                length = parts[second].centroid[1] - parts[first].centroid[1]
                section = Rectangle((s1 - s0) * float(planform.chord(y)), float(planform.thickness(y)))
                foam = _rigidities(section, _grillage(max(inner, outer)), True) / length
                rod = np.zeros(6)
                for r in planform.wing.rods:
                    x = rod_at(r, y)
                    if x is not None and s0 <= min(planform.fraction(x, y), 1 - 1e-9) < s1:
                        rod = rod + _rod_rigidities(r.diameter) / length
                point = np.array([planform.x(0.5 * (s0 + s1), y), y, 0.0])
                found.append(Connector(first, second, point, foam, rod, SPANWISE_MODULUS))
    return found


def _along_chord(planform: Planform, division: Division, panels: list[Panel], parts: list[Body]) -> list[Connector]:
    found = []
    for strip, count in enumerate(division.bodies):
        for k in range(count - 1):
            first, second = division.index(strip, k), division.index(strip, k + 1)
            panel = panels[first]
            y = 0.5 * (panel.y0 + panel.y1)
            length = parts[second].centroid[0] - parts[first].centroid[0]
            section = Rectangle(panel.y1 - panel.y0, float(planform.thickness(y)))
            foam = _rigidities(section, 0.5, False) / length
            point = np.array([planform.x(panel.s1, y), y, 0.0])
            found.append(Connector(first, second, point, foam, np.zeros(6), CHORDWISE_MODULUS))
    return found


def _at_root(planform: Planform, division: Division, panels: list[Panel], parts: list[Body]) -> list[Connector]:
    """The driven rods hold the root: each the body it enters, with the foam of that body shared among its rods."""
    wing = planform.wing
    y = wing.stations[0].y
    entries = []
    for number, name in enumerate(wing.driven_rods):
        rod = next(r for r in wing.rods if r.name == name)
        x = rod_at(rod, max(y, rod.y_root))
        if x is None or rod.y_root > y + 0.02:
            raise ValueError(
                f"driven rod {name!r} starts at y = {rod.y_root:g} m, over 0.02 m outboard of the root at {y:g} m; "
                "it must reach the root to drive the wing"
            )
        fraction = min(planform.fraction(x, y), 1 - 1e-9)
        entries.append((number, rod, x, int(fraction * division.bodies[0])))
    found = []
    for number, rod, x, body in entries:
        sharing = sum(other == body for *_, other in entries)
        panel = panels[body]
        section = Rectangle((panel.s1 - panel.s0) * float(planform.chord(y)), float(planform.thickness(y)))
        length = parts[body].centroid[1] - y
        foam = _rigidities(section, _grillage(division.bodies[0]), True) / length / sharing
        rigid = _rod_rigidities(rod.diameter) / length
        found.append(Connector(-1 - number, body, np.array([x, y, 0.0]), foam, rigid, SPANWISE_MODULUS))
    return found


def _wiring(
    planform: Planform, division: Division, panels: list[Panel], parts: list[Body], connectors: list[Connector]
) -> Wiring:
    n = len(parts)
    hinge = np.array([0.0, planform.wing.hinge.y, planform.wing.hinge.z])
    first = np.array([c.first if c.first >= 0 else n - 1 - c.first for c in connectors], np.int64)
    second = np.array([c.second for c in connectors], np.int64)
    base = [c.point - (parts[c.first].centre if c.first >= 0 else hinge) for c in connectors]
    b = np.array([c.point - parts[c.second].centre for c in connectors])
    pairs = {(int(j), int(i)) for i, j in zip(first, second, strict=True) if i < n}
    pattern = _symbolic(n, pairs)
    starts = np.concatenate([[0], np.cumsum(division.bodies)]).astype(np.int64)
    area = np.array([part.area for part in parts])
    strip_area = np.add.reduceat(area, starts[:-1])
    markers = planform.wing.markers
    carriers = marker_carriers(planform, panels, markers)
    return Wiring(
        mass=np.array([part.mass for part in parts]),
        inertia=np.array([part.inertia.ravel() for part in parts]),
        first=first,
        second=second,
        block=np.array(
            [n + pattern.number[(int(j), int(i))] if i < n else -1 for i, j in zip(first, second, strict=True)],
            np.int64,
        ),
        driven=int(np.argmax(first >= n)),
        a=np.array(base),
        b=b,
        start=pattern.start,
        below=pattern.below + n,
        row=pattern.row,
        products=pattern.products,
        product_start=pattern.product_start,
        strip_start=starts,
        weight=area / np.repeat(strip_area, division.bodies),
        centroid=np.array([(part.centroid - part.centre)[:2] for part in parts]),
        area=strip_area,
        markers=np.array([np.array(m.position) - parts[k].centre for m, k in zip(markers, carriers, strict=True)]),
        carrier=carriers,
    )


@dataclass(frozen=True)
class _Pattern:
    number: dict[tuple[int, int], int]
    start: npt.NDArray[np.int64]
    below: npt.NDArray[np.int64]
    row: npt.NDArray[np.int64]
    products: npt.NDArray[np.int64]
    product_start: npt.NDArray[np.int64]


def _symbolic(n: int, pairs: set[tuple[int, int]]) -> _Pattern:
    """Symbolic Cholesky: fill-in and the list of block products, for lower block positions (row, column)."""
    filled = set(pairs)
    for column in range(n):
        rows = sorted(r for r, c in filled if c == column)
        filled |= {(r, q) for q in rows for r in rows if r > q}
    number = {position: k for k, position in enumerate(sorted(filled, key=lambda rc: (rc[1], rc[0])))}
    start, below, row, products, product_start = [0], [], [], [], [0]
    for column in range(n):
        rows = sorted(r for r, c in filled if c == column)
        below += [number[(r, column)] for r in rows]
        row += rows
        start.append(len(below))
        for q in rows:
            for r in (r for r in rows if r >= q):
                target = q if r == q else n + number[(r, q)]
                products.append((target, n + number[(r, column)], n + number[(q, column)]))
        product_start.append(len(products))
    return _Pattern(
        number,
        np.array(start, np.int64),
        np.array(below, np.int64),
        np.array(row, np.int64),
        np.array(products, np.int64).reshape(-1, 3),
        np.array(product_start, np.int64),
    )
