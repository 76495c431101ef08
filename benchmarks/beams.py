"""Error of the discretisation into rigid bodies: beams against beam theory, the Robird's wing against finer divisions.

``python -m benchmarks.beams [--json | --table] [--quick]``

Natural frequencies are computed from the stiffness of the compiled connectors at rest and the bodies' masses, large
deflections from equilibrium with the compiled spring forces, the wing's motion with the simulator itself. A division
"16x4" has 16 strips along the span with 4 bodies each along the chord.
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh

from benchmarks.common.machine import commit, cpu
from benchmarks.physics.beam_theory import Beam, Family, elastica, reference, torsion_constant
from benchmarks.physics.plates import displacement, stiffness_matrix
from benchmarks.physics.spring_chain import cut_beam, genome, spring_chain
from wingfit.records import Wing
from wingfit.records.blas_threads import one_blas_thread
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.structure import Structure

Array = npt.NDArray[np.float64]

# Shear and rotary inertia change the third frequency of the uniform rod by 3e-5.
UNIFORM_ROD = Beam(4.0, (0.006, 0.006), (0.005, 0.005))
TAPERED_ROD = Beam(4.0, (0.006, 0.004), (0.005, 0.003))
UNIFORM_SHEET = Beam(1.0, (0.1, 0.1), (0.0025, 0.0025))
TAPERED_SHEET = Beam(1.0, (0.1, 0.06), (0.0025, 0.0015))
THICK_PLATE = Beam(1.0, (0.2, 0.2), (0.01, 0.01))
STOCKY = Beam(0.5, (0.1, 0.1), (0.05, 0.05))
# name, beam, families, whether shear and rotary inertia are negligible
CASES: tuple[tuple[str, Beam, tuple[Family, ...], bool], ...] = (
    ("uniform rod", UNIFORM_ROD, ("flapwise", "in-plane"), True),
    ("tapered rod", TAPERED_ROD, ("flapwise", "in-plane"), True),
    ("uniform sheet", UNIFORM_SHEET, ("torsion",), True),
    ("tapered sheet", TAPERED_SHEET, ("torsion",), True),
    ("stocky beam", STOCKY, ("flapwise", "in-plane"), False),
)
STRIPS = (2, 4, 8, 16, 32, 64)
CHORDWISE = (1, 2, 4)
MOST_BODIES = 128
LOADS = (1.0, 2.0)
ELASTIC = Beam(0.5, (0.01, 0.01), (0.002, 0.002))
# by number of bodies along the chord: numbers of strips, each twice the one before
WING_STRIPS: dict[int, tuple[int, ...]] = {1: (4, 8, 16, 32, 64), 4: (6, 12, 24)}
QUICK_WING: dict[int, tuple[int, ...]] = {1: (4, 8, 16)}
FINEST = "16x8"
DIVISIONS = ("4", "11", "24", "64x1", "32x2", "32x3", "32x4", "20x6", "12x8")
WING_NUMERICS = Numerics(steps=480, max_beats=60, periodic=2e-6)
# Which of a body's six coordinates (rotation x, y, z, then translation) move together in a flat wing.
_OUT_OF_PLANE, _IN_PLANE = (0, 1, 5), (2, 3, 4)
_KEPT = 24  # number of the lowest modes that are examined
_ABSENT = 0.5  # relative error above which a frequency belongs to another mode


@dataclass(frozen=True)
class Row:
    """Relative errors of the first three frequencies of one family of modes for one discretisation.

    ``strips``: number of strips along the span; ``chordwise``: bodies along the chord in each. An error is NaN where
    there are too few bodies for the mode.
    """

    case: str
    family: Family
    chordwise: int
    strips: int
    errors: tuple[float, ...]


def modes(structure: Structure, moduli: dict[str, float], held: int) -> dict[Family, Array]:
    """Return the natural frequencies (Hz, rising) of the bodies on their springs, by family of modes.

    ``moduli``: gene values by name; the first ``held`` bodies are fixed. A mode belongs to a family if more than half
    of its kinetic energy is in that family's motion of strips that are rigid along the chord; other modes are omitted.
    """
    n = len(structure.bodies)
    K = stiffness_matrix(structure, moduli).reshape(n, 6, n, 6)[held:, :, held:, :]
    mass = np.array([b.mass for b in structure.bodies[held:]])
    M = np.zeros_like(K)
    for k, body in enumerate(structure.bodies[held:]):
        M[k, :3, k, :3] = body.inertia
        M[k, 3:, k, 3:] = body.mass * np.eye(3)
    strip = np.repeat(np.arange(len(structure.division.bodies)), structure.division.bodies)[held:]
    members = (strip == np.unique(strip)[:, None]).astype(float)
    mean = members * mass / (members @ mass)[:, None]
    width = np.array([b.centre[0] for b in structure.bodies[held:]])
    polar = members @ (M[range(n - held), 1, range(n - held), 1] + mass * (width - (members.T @ (mean @ width))) ** 2)
    found: dict[Family, list[float]] = {"flapwise": [], "in-plane": [], "torsion": []}
    for group, bending, across in ((_OUT_OF_PLANE, 0, 5), (_IN_PLANE, 2, 3)):
        ix = np.ix_(range(n - held), group, range(n - held), group)
        size = (n - held) * len(group)
        # largest eigenvalues of (M, K), because the smallest of (K, M) would be inaccurate
        top = (max(0, size - _KEPT), size - 1)
        mu, shape = eigh(M[ix].reshape(size, size), K[ix].reshape(size, size), subset_by_index=top)
        for value, u in zip(mu[::-1], shape.T[::-1], strict=True):
            motion = np.zeros((n - held, 6))
            motion[:, group] = u.reshape(n - held, len(group))
            sway = members @ mass @ (mean @ motion[:, across]) ** 2
            tilt = M[range(n - held), bending, range(n - held), bending] @ motion[:, bending] ** 2
            twist = polar @ (mean @ motion[:, 1]) ** 2 if across == 5 else 0.0
            frequency = 1 / (2 * math.pi * math.sqrt(value)) if value > 0 else math.inf
            if sway + tilt > 0.5 * value:
                found["flapwise" if across == 5 else "in-plane"].append(frequency)
            elif twist > 0.5 * value:
                found["torsion"].append(frequency)
    return {family: np.array(values) for family, values in found.items()}


def frequency_errors(
    name: str, beam: Beam, families: tuple[Family, ...], slender: bool, chordwise: int, strips: int
) -> list[Row]:
    """Return the frequency errors of ``beam``, called ``name``, in one discretisation, by family of modes.

    There are ``strips`` times ``chordwise`` bodies. ``slender``: whether the reference omits shear and rotary inertia.
    With one body along the chord the beam hangs on the rods at the root. The two rods cannot hold more than two bodies,
    so otherwise the first strip is held instead, and the beam begins at that strip's middle.
    """
    structure = cut_beam(beam, f"{strips}x{chordwise}")
    held = 0 if chordwise == 1 else chordwise
    root = float(structure.bodies[0].centroid[1]) if held else 0.0
    found, rows = modes(structure, genome(beam), held), []
    for family in families:
        truth = reference(beam, family, root, slender=slender, chordwise=chordwise)
        values = np.full(3, np.nan)
        values[: min(3, len(found[family]))] = found[family][:3]
        errors = values / truth - 1
        rows.append(Row(name, family, chordwise, strips, tuple(float(e) if e < _ABSENT else math.nan for e in errors)))
    return rows


def frequency_table(strips: tuple[int, ...] = STRIPS) -> list[Row]:
    """Return the frequency errors of all beams with all numbers of ``strips``, in the order of ``CASES``."""
    rows = [
        row
        for name, beam, families, slender in CASES
        for chordwise in CHORDWISE
        for n in strips
        if n * chordwise <= MOST_BODIES
        for row in frequency_errors(name, beam, families, slender, chordwise, n)
    ]
    order = [(name, family) for name, _, families, _ in CASES for family in families]
    return sorted(rows, key=lambda r: (order.index((r.case, r.family)), r.chordwise, r.strips))


def torsion_carried(structure: Structure) -> float:
    """Return the fraction of the section's torsional stiffness that a uniform sheet's connectors carry.

    Under a uniform twist kappa (rad/m), neighbours along the span, and neighbours along the chord, rotate relative to
    each other by kappa times their distance. The result is the energy of both kinds of connectors per length, for one
    strip in the middle, divided by G J kappa^2 / 2 (shear modulus G, torsion constant J).
    """
    n, strip = structure.division.bodies[0], len(structure.division.bodies) // 2
    station = structure.wing.stations[0]
    width = structure.wing.span / len(structure.division.bodies)
    body = range(strip * n, (strip + 1) * n)
    along = sum(c.foam[1] * width for c in structure.connectors if c.first in body and c.second == c.first + n)
    across = sum(
        c.foam[0] * (station.chord / n) ** 2 / width
        for c in structure.connectors
        if n > 1 and c.first in body and c.second == c.first + 1
    )
    return float((along + across) / torsion_constant(station.chord, station.thickness))


def twist_rate(beam: Beam, division: str) -> float:
    """Return the twist per length of a divided beam under a tip moment, relative to Saint-Venant's T / (G J).

    T is the moment, G the shear modulus, J the torsion constant; the twist is that of the middle half of the beam.
    ``division``: the discretisation.
    """
    structure = cut_beam(beam, division)
    n, strips = structure.division.bodies[0], len(structure.division.bodies)
    load = np.zeros((len(structure.bodies), 6))
    load[-n:, 1] = 1 / n
    turn = displacement(stiffness_matrix(structure, genome(beam)), load)[:, 1].reshape(strips, n).mean(axis=1)
    a, b = strips // 4, strips - 1 - strips // 4
    expected = (b - a) * beam.length / strips / (beam.shear * float(torsion_constant(beam.chord[0], beam.thickness[0])))
    return float((turn[b] - turn[a]) / expected)


def twist_table() -> list[dict[str, Any]]:
    """Return rows of :func:`twist_rate` for the uniform sheet and a plate as thick as the wing, by division."""
    return [
        {"plate": name, "division": division, "twist": twist_rate(beam, division)}
        for name, beam, strips in (("uniform sheet", UNIFORM_SHEET, (16, 32)), ("thick plate", THICK_PLATE, (16, 32)))
        for division in (f"{n}x{c}" for c in CHORDWISE for n in strips)
    ]


def observed_order(coarse: float, fine: float, refinement: float = 2.0) -> float:
    """Return the order p of an error that is proportional to the p-th power of the strips' width.

    ``coarse``, ``fine``: errors before and after refinement by the factor ``refinement``; NaN if one of them is NaN.
    """
    return math.log(abs(coarse / fine)) / math.log(refinement)


def elastica_table(strips: tuple[int, ...] = STRIPS) -> list[dict[str, float]]:
    """Return the errors of tip deflection and shortening of chains of rigid bodies under large loads.

    They are relative to the length; one row per load P L^2 / (E I) in LOADS and number of ``strips``.
    """
    rows = []
    for load in LOADS:
        truth = elastica(load)
        for n in strips:
            found = spring_chain(ELASTIC, n, load)
            rows.append(
                {"load": load, "strips": n, "deflection": found[0] - truth[0], "shortening": found[1] - truth[1]}
            )
    return rows


def rods_to_the_tip(wing: Wing) -> Wing:
    """Return a copy of ``wing`` with its rods extended along their lines to the tip station."""
    rods = []
    for rod in wing.rods:
        y = wing.stations[-1].y
        stretch = (y - rod.y_root) / (rod.y_tip - rod.y_root)
        rods.append(replace(rod, x_tip=rod.x_root + stretch * (rod.x_tip - rod.x_root), y_tip=y))
    return replace(wing, rods=tuple(rods))


WINGS = {"robird": robird_wing(), "rods to the tip": rods_to_the_tip(robird_wing())}


def wing_tracks(wing: Wing, division: str, numerics: Numerics = WING_NUMERICS) -> Array:
    """Simulate and return the periodic marker tracks [n, M, 3] (m) of M markers at n instants of the beat.

    Flapping at 3 Hz at a pressure of 10 mbar, with nominal genes and a phase lag of 3 degrees between the rods.
    """
    model = FlexibleWing(wing, division, numerics=numerics)
    recording = blank_recording(model.wing, vacuum(10.0, math.radians(3.0), 3.0))
    beat = model.beat([g.nominal for g in model.genes], recording)
    if beat.reason:
        raise RuntimeError(f"{division}: {beat.reason}")
    return np.asarray(beat.tracks)


def wing_table(strips: dict[int, tuple[int, ...]], numerics: Numerics = WING_NUMERICS) -> list[dict[str, Any]]:
    """Return the mean and largest distance (m) over a beat between markers with n and with 2 n strips.

    ``strips``: numbers of strips, by number of bodies along the chord. One row per discretisation; ``order``:
    convergence order from two successive mean distances. The distance from the limit of many strips is the sum of a
    row's distance and all following ones.
    """
    rows: list[dict[str, Any]] = []
    for name, wing in WINGS.items():
        for chordwise, cuts in strips.items():
            tracks = [wing_tracks(wing, f"{n}x{chordwise}", numerics) for n in cuts]
            before = math.nan
            for n, coarse, fine in zip(cuts[:-1], tracks[:-1], tracks[1:], strict=True):
                distance = np.linalg.norm(coarse - fine, axis=-1)
                mean, largest = float(distance.mean()), float(distance.max())
                rows.append(
                    {
                        "wing": name, "chordwise": chordwise, "strips": n, "mean_m": mean, "largest_m": largest,
                        "order": observed_order(before, mean),
                    }
                )  # fmt: skip
                before = mean
    return rows


def chord_table(divisions: tuple[str, ...]) -> list[dict[str, Any]]:
    """Return the mean and largest distance (m) of the Robird's markers from those with the discretisation FINEST.

    One row for each of ``divisions``, over a beat.
    """
    finest, rows = wing_tracks(WINGS["robird"], FINEST), []
    for division in divisions:
        distance = np.linalg.norm(wing_tracks(WINGS["robird"], division) - finest, axis=-1)
        rows.append({"division": division, "mean_m": float(distance.mean()), "largest_m": float(distance.max())})
    return rows


def _cells(values: list[float], form: str) -> str:
    return " | ".join("-" if not math.isfinite(v) else format(v, form) for v in values)


def _markdown(head: list[str], rows: list[str]) -> str:
    rule = "|" + "---|" * len(head)
    return "\n".join([f"| {' | '.join(head)} |", rule, *(f"| {row} |" for row in rows)])


def frequency_markdown(rows: list[Row]) -> str:
    """Return a markdown table of frequency errors: a row per family, number of bodies along the chord, and mode.

    Columns: error in per cent by number of strips, and the convergence order of the last refinement.
    """
    strips, lines = sorted({r.strips for r in rows}), []
    for key in dict.fromkeys((r.case, r.family, r.chordwise) for r in rows):
        found = {r.strips: r.errors for r in rows if (r.case, r.family, r.chordwise) == key}
        for mode in range(3):
            errors = [found[n][mode] if n in found else math.nan for n in strips]
            here = [e for e in errors if math.isfinite(e)]
            order = observed_order(here[-2], here[-1]) if len(here) > 1 else math.nan
            percent = _cells([100 * e for e in errors], "+.3f")
            lines.append(f"{key[0]} | {key[1]} | {key[2]} | {mode + 1} | {percent} | {_cells([order], '.2f')}")
    return _markdown(["beam", "motion", "along the chord", "mode", *(f"{n} strips" for n in strips), "order"], lines)


def table(figures: dict[str, Any], rows: list[Row]) -> str:
    """Return all ``figures``, and the frequency errors ``rows``, as tables in markdown."""
    mm = 1e3
    bent = [
        f"{r['load']:g} | {r['strips']} | {100 * r['deflection']:+.4f} | {100 * r['shortening']:+.4f}"
        for r in figures["elastica"]
    ]
    twisted = [f"{r['plate']} | {r['division']} | {100 * (r['twist'] - 1):+.3f}" for r in figures["twist"]]
    wing = [
        f"{r['wing']} | {r['strips']}x{r['chordwise']} | {2 * r['strips']}x{r['chordwise']} | "
        f"{mm * r['mean_m']:.3f} | {mm * r['largest_m']:.3f} | {_cells([r['order']], '.2f')}"
        for r in figures["wing"]
    ]
    chord = [f"{r['division']} | {mm * r['mean_m']:.2f} | {mm * r['largest_m']:.2f}" for r in figures["chord"]]
    parts = (
        ("Error of the first three frequencies, %", frequency_markdown(rows)),
        ("Twist under a couple: error, %", _markdown(["plate", "division", "twist"], twisted)),
        (
            "Elastica: error of the tip, % of the length",
            _markdown(["P L^2 / E I", "strips", "deflection", "shortening"], bent),
        ),
        (
            "Robird wing: distance of the markers, mm",
            _markdown(["wing", "division", "against", "mean", "largest", "order"], wing),
        ),
        (f"Robird wing: distance of the markers from {FINEST}, mm", _markdown(["division", "mean", "largest"], chord)),
    )
    return "\n\n".join(f"## {title}\n\n{text}" for title, text in parts)


def _without_nan(value: Any) -> Any:
    """Return ``value`` with None in place of NaN and infinity, which JSON does not have."""
    if isinstance(value, dict):
        return {key: _without_nan(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@one_blas_thread  # on such small matrices several threads take ten times as long
def main() -> None:
    """Parse the command line, compute all tables, and print them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.beams", description=__doc__)
    shown = parser.add_mutually_exclusive_group()
    shown.add_argument("--json", action="store_true", help="print only the JSON object")
    shown.add_argument("--table", action="store_true", help="print only the tables, in markdown")
    parser.add_argument("--quick", action="store_true", help="at most 16 strips")
    arguments = parser.parse_args()
    strips = tuple(n for n in STRIPS if n <= 16 or not arguments.quick)
    rows = frequency_table(strips)
    figures: dict[str, Any] = {
        "frequencies": [asdict(r) for r in rows],
        "twist": twist_table(),
        "elastica": elastica_table(strips),
        "wing": wing_table(QUICK_WING if arguments.quick else WING_STRIPS),
        "chord": chord_table(DIVISIONS[:3] if arguments.quick else DIVISIONS),
        "cpu": cpu(),
        "commit": commit(),
    }
    if not arguments.json:
        print(table(figures, rows))
    if not arguments.table:
        print(json.dumps(_without_nan(figures)))


if __name__ == "__main__":
    main()
