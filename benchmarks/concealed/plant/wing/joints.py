"""Springs and dampers between the bodies of a wing, and each body's share of the air loads.

Van der Grinten's thesis, Eqs. 12-13 and 15-17.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.wing.geometry import Cut
from wingfit.records import Rod

Array = npt.NDArray[np.float64]

_REACH = 0.02  # m: largest distance of the start of a driven rod from the root
_SERIES = 15  # terms of the torsion constant


@dataclass(frozen=True)
class Joint:
    """Joint of body ``first`` (-1: front driving rod, -2: rear one) and body ``second`` at ``point`` (wing frame, m).

    ``stiffness``, ``damping`` [6]: about x, y, z (N m/rad, N m s/rad), then along x, y, z (N/m, N s/m). ``of_rods``:
    the rods' part of the bending stiffness, N m/rad. ``along_span``: whether the bodies are neighbours along the span,
    not the chord. ``from_y``, ``to_y``: the stretch of wing that the joint represents, m; ``length``: distance of the
    bodies' centroids, or from the root to the first centroid, m.
    """

    first: int
    second: int
    point: Array
    stiffness: Array
    damping: Array
    of_rods: float
    along_span: bool
    from_y: float
    to_y: float
    length: float


def torsion_constant(width: float, thickness: float) -> float:
    """Torsion constant of a rectangle, m^4 (Saint-Venant; Roark's Formulas, table 10.1, full series)."""
    a, b = max(width, thickness), min(width, thickness)
    n = np.arange(1, 2 * _SERIES, 2)
    return float(a * b**3 * (1 / 3 - 64 / math.pi**5 * b / a * np.sum(np.tanh(n * math.pi * a / (2 * b)) / n**5)))


class _Maker:
    def __init__(self, cut: Cut, genome: Mapping[str, float]) -> None:
        self.cut, self.genome = cut, genome
        young, shear = (genome["E_f"], genome["D_E"]), (genome["G_f"], genome["D_G"])
        # modulus and damping of each of the six directions
        self.spanwise = np.array([young, shear, young, shear, young, shear])
        self.chordwise = np.array([shear, young, young, young, shear, shear])

    def joint(
        self, pair: tuple[int, int], point: tuple[float, float], section: Array, along_span: bool,
        length: float, over: tuple[float, float], rods: list[Rod],
    ) -> Joint:  # fmt: skip
        """Make the joint of the bodies ``pair`` at ``point`` (x, y), m.

        ``section`` [6]: foam's second moments (m^4) about x, y, z and areas (m^2) along x, y, z; ``length``: between
        the bodies, m; ``over``: span positions (m) between which it represents the wing; ``rods`` stiffen it.
        """
        foam = section[:, None] * (self.spanwise if along_span else self.chordwise)
        plain = foam[:, 0] / length
        stiffness = self._with_rods(foam[:, 0], rods, *over) / length if rods else plain
        return Joint(
            *pair, np.array([*point, 0.0]), stiffness, foam[:, 1] / length,
            float(stiffness[0] - plain[0]) if rods else 0.0, along_span, *over, length,
        )  # fmt: skip

    def _with_rods(self, foam: Array, rods: list[Rod], y0: float, y1: float) -> Array:
        """Mean rigidity [6] (N m^2, N) between y0 and y1 (m): rods parallel to ``foam`` [6], intervals in series."""
        cuts = np.unique(np.clip([y0, y1] + [end for rod in rods for end in (rod.y_root, rod.y_tip)], y0, y1))
        flexibility = np.zeros(6)
        for a, b in pairwise(cuts):
            rigidity = foam.copy()
            for rod in rods:
                if rod.y_root <= 0.5 * (a + b) <= rod.y_tip:
                    bending = self.genome["E_r"] * math.pi * rod.diameter**4 / 64
                    shearing = self.genome["G_r"] * math.pi * rod.diameter**2 / 4
                    rigidity += np.array([bending, 0.0, bending, shearing, 0.0, shearing])
            with np.errstate(divide="ignore"):
                flexibility += (b - a) / rigidity
        return np.asarray((y1 - y0) / flexibility)

    def twisting(self, y: float) -> float:
        """Torsion constant of the wing's section at span position ``y`` (m) divided by the chord, m^3."""
        _, chord, thickness = self.cut.section(y)
        return torsion_constant(chord, thickness) / chord

    def along_span(self) -> list[Joint]:
        found = []
        for strip in range(len(self.cut.counts) - 1):
            found += self._border(strip)
        return found

    def _border(self, strip: int) -> list[Joint]:
        """Joints between the bodies of ``strip`` and those of the next strip outboard."""
        cut = self.cut
        a, b = cut.start[strip], cut.start[strip + 1]
        inner, outer = cut.counts[strip], cut.counts[strip + 1]
        y, y0, y1 = float(cut.edges[strip + 1]), float(cut.centroid[a, 1]), float(cut.centroid[b, 1])
        _, chord, h = cut.section(y)
        # shear along and across the section carry half of a torque each; joints along the chord carry the latter at
        # (n - 1) of n places, so that half of 1 + 1 / n remains for these joints
        share = 0.5 * (0.5 + 0.5 / inner + 0.5 + 0.5 / outer)
        rods, found = self._rods(strip, y0, y1), []
        for i in range(inner):
            for j in range(outer):
                s0, s1 = max(i / inner, j / outer), min((i + 1) / inner, (j + 1) / outer)
                if s1 - s0 < 1e-9:
                    continue
                w, pair = (s1 - s0) * chord, (int(a) + i, int(b) + j)
                A = w * h
                section = np.array([w * h**3 / 12, self.twisting(y) * w * share, h * w**3 / 12, A, A, A])
                point = (cut.x_at(0.5 * (s0 + s1), y), y)
                found.append(self.joint(pair, point, section, True, y1 - y0, (y0, y1), rods.pop(pair, [])))
        for pair, lonely in rods.items():  # rods that pass from one part of the chord to another
            x = float(np.mean([_x_of(rod, y) for rod in lonely]))
            found.append(self.joint(pair, (x, y), np.zeros(6), True, y1 - y0, (y0, y1), lonely))
        return found

    def _rods(self, strip: int, y0: float, y1: float) -> dict[tuple[int, int], list[Rod]]:
        """Rods between y0 and y1 (m), by the (inner, outer) bodies that they join across the border of two strips.

        A rod that begins or ends in between joins the bodies at its own chord position there.
        """
        found: dict[tuple[int, int], list[Rod]] = {}
        for rod in self.cut.wing.rods:
            begin, end = max(rod.y_root, y0), min(rod.y_tip, y1)
            if begin < end:
                inner = self._piece(strip, rod, begin if begin == y0 else end)
                outer = self._piece(strip + 1, rod, end if end == y1 else begin)
                found.setdefault((inner, outer), []).append(rod)
        return found

    def _piece(self, strip: int, rod: Rod, y: float) -> int:
        """Number of the body of ``strip`` that contains the rod at span position ``y`` (m)."""
        edge, chord, _ = self.cut.section(y)
        count = self.cut.counts[strip]
        part = min(max((_x_of(rod, y) - edge) / chord, 0.0), 1.0)
        return int(self.cut.start[strip]) + min(int(part * count), count - 1)

    def along_chord(self) -> list[Joint]:
        cut, found = self.cut, []
        for strip, count in enumerate(cut.counts):
            y0, y1 = float(cut.edges[strip]), float(cut.edges[strip + 1])
            y, w = 0.5 * (y0 + y1), y1 - y0
            h = cut.section(y)[2]
            section = np.array([0.5 * self.twisting(y) * w, w * h**3 / 12, h * w**3 / 12, w * h, w * h, w * h])
            for n in range(int(cut.start[strip]), int(cut.start[strip]) + count - 1):
                length = float(cut.centroid[n + 1, 0] - cut.centroid[n, 0])
                point = (cut.x_at(float(cut.s1[n]), y), y)
                found.append(self.joint((n, n + 1), point, section, False, length, (y0, y1), []))
        return found

    def at_root(self) -> list[Joint]:
        """Joints between the driving rods and the innermost bodies; stiffness of rod and foam in parallel.

        ValueError if a driven rod does not reach the root.
        """
        cut, wing = self.cut, self.cut.wing
        y, y1 = float(cut.edges[0]), float(cut.centroid[0, 1])
        rods = [next(rod for rod in wing.rods if rod.name == name) for name in wing.driven_rods]
        for rod in rods:
            if rod.y_root > y + _REACH or rod.y_tip < y:
                raise ValueError(
                    f"driven rod {rod.name!r} begins at {rod.y_root:g} m, the root is at {y:g} m: bring it there"
                )
        held = [self._piece(0, rod, min(y1, rod.y_tip)) for rod in rods]
        _, chord, h = cut.section(y)
        w, found = chord / cut.counts[0], []
        for k, (rod, body) in enumerate(zip(rods, held, strict=True)):
            torsion = self.twisting(y) * w * (0.5 + 0.5 / cut.counts[0])
            section = np.array([w * h**3 / 12, torsion, h * w**3 / 12, w * h, w * h, w * h]) / held.count(body)
            point = (_x_of(rod, max(y, rod.y_root)), y)
            longer = Rod(
                rod.name, rod.x_root, min(y, rod.y_root), rod.x_tip, rod.y_tip, rod.diameter, rod.density, 0.0
            )  # fmt: skip
            found.append(self.joint((-1 - k, body), point, section, True, y1 - y, (y, y1), [longer]))
        return found


def _x_of(rod: Rod, y: float) -> float:
    return rod.x_root + (y - rod.y_root) * (rod.x_tip - rod.x_root) / (rod.y_tip - rod.y_root)


def joints(cut: Cut, genome: Mapping[str, float]) -> list[Joint]:
    """All joints of the divided wing ``cut``.

    ``genome``: moduli of foam and rods E_f, E_r, G_f, G_r (Pa) and damping of the foam D_E, D_G (Pa s).
    """
    maker = _Maker(cut, genome)
    return [*maker.along_span(), *maker.along_chord(), *maker.at_root()]


def shares(cut: Cut, genome: Mapping[str, float], prefix: str) -> Array:
    """[N, 2]: each body's share of its strip's force, and x (m) of the point of attack from the body's centre.

    Van der Grinten's thesis, Eqs. 12-13: the four genes ``prefix``_1 to ``prefix``_4 are the weights of the quarters of
    the chord, each spread evenly. ``prefix``: "L" for lift, "ID" for drag.
    """
    weights = np.array([genome[f"{prefix}_{k}"] for k in range(1, 5)])
    weights = weights / weights.sum()
    centre, out = cut.bodies[1], np.zeros((len(cut.strip), 2))
    for n in range(len(out)):
        y = 0.5 * float(cut.edges[cut.strip[n]] + cut.edges[cut.strip[n] + 1])
        lower = np.maximum(cut.s0[n], np.arange(4) / 4)
        upper = np.minimum(cut.s1[n], (np.arange(4) + 1) / 4)
        part = 4 * weights * np.maximum(upper - lower, 0.0)
        x = np.array([cut.x_at(float(s), y) for s in 0.5 * (lower + upper)])
        out[n] = part.sum(), part @ x / part.sum() - centre[n, 0]
    return out
