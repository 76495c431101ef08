"""The genes of the flexible wing (thesis Eqs. 18 and 19), and the inputs of the kernels that are computed from them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np

from wingfit.records import EstimateError, Gene
from wingfit.records.array_types import Array
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import Lanes, Laws
from wingfit.sim.kernels.lanes.memory import aligned
from wingfit.sim.wing.structure import QUARTERS, Structure, spring_constants

Group = Literal["structure", "aerodynamics"]

UNIT_SLIP = 1e4  # ratio of an estimate to the typical value beyond which its unit must be wrong
FACTOR = 5.0  # bounds of the thesis: a fifth to five times the estimate (IV-E)

# name, unit, default estimate, description
_STRUCTURE = (
    ("E_f", "Pa", 6.0e6, "Young's modulus of the foam with its skin"),
    ("E_r", "Pa", 1.2e11, "Young's modulus of the carbon rods with their glue"),
    ("G_f", "Pa", 2.2e6, "shear modulus of the foam with its skin"),
    ("G_r", "Pa", 3.0e9, "shear modulus of the carbon rods with their glue"),
    ("D_E", "Pa s", 6.0e4, "damping associated with Young's modulus of the foam"),
    ("D_G", "Pa s", 2.5e4, "damping associated with the shear modulus of the foam"),
)
_AERODYNAMICS = (
    ("L_a", "1/rad", 4.0, "slope of the lift coefficient with angle of attack"),
    ("L_b", "1", 0.3, "lift coefficient at zero angle of attack"),
    ("ID_a", "1/rad", 0.8, "slope of the induced-drag coefficient with the magnitude of the angle of attack"),
    ("ID_b", "1", 0.08, "induced-drag coefficient at zero angle of attack"),
)
_SHARES = (0.4, 0.3, 0.2, 0.1)

_NO_LAW, _NOWHERE = np.zeros((0, 6), np.int64), np.zeros(0, np.int64)
NO_LAWS = Laws(
    strip=_NO_LAW, connector=_NO_LAW, point=_NO_LAW[:, :5], axes=_NOWHERE, bodies=_NOWHERE,
    arms=np.zeros((0, 3, LANES)), parameters=np.zeros((0, LANES)), size=np.zeros(0), motor=np.zeros((0, LANES)),
)  # fmt: skip

STRUCTURAL = tuple(row[0] for row in _STRUCTURE)
ROD_GENES = ("E_r", "G_r")
_WEIGHTS = tuple(f"{prefix}_{k}" for prefix in ("L", "ID") for k in range(1, QUARTERS + 1))
AERODYNAMIC = (*(row[0] for row in _AERODYNAMICS), *_WEIGHTS)


def group(name: str) -> Group:
    """Tell whether the gene called ``name`` belongs to the structure or to the aerodynamics."""
    return "structure" if name in STRUCTURAL else "aerodynamics"


def wing_genes(estimates: Mapping[str, float], factor: float = FACTOR) -> tuple[Gene, ...]:
    """All genes of the wing, each bounded by its nominal value divided and multiplied by ``factor``.

    ``estimates``: nominal values by name, which replace defaults. EstimateError if a name is unknown or a value
    implausible (wrong by a factor of UNIT_SLIP).
    """
    rows = [*_STRUCTURE, *_AERODYNAMICS]
    for prefix, what in (("L", "lift"), ("ID", "induced drag")):
        for k, share in enumerate(_SHARES, 1):
            rows.append((f"{prefix}_{k}", "1", share, f"weight of the strip's {what} on quarter {k} of the chord"))
    known = [row[0] for row in rows]
    for name, value in estimates.items():
        if name not in known:
            raise EstimateError(f"estimate for unknown gene {name!r}; the flexible wing has {', '.join(known)}")
        unit, typical = next((row[1], row[2]) for row in rows if row[0] == name)
        if not (np.isfinite(value) and typical / UNIT_SLIP <= value <= typical * UNIT_SLIP):
            raise EstimateError(
                f"estimate of gene {name!r} is {value:g} {unit}; it must lie in "
                f"[{typical / UNIT_SLIP:g}, {typical * UNIT_SLIP:g}] {unit}: check its unit"
            )
    genes = []
    for name, unit, default, text in rows:
        nominal, shared = estimates.get(name, default), name.rpartition("_")[0] if name[-1].isdigit() else None
        genes.append(Gene(name, unit, nominal, nominal / factor, nominal * factor, "log", text, shared))
    return tuple(genes)


def lanes(structure: Structure, genes: tuple[Gene, ...], genomes: Array) -> Lanes:
    """Inputs of the kernels for up to LANES ``genomes`` [B, G]: stiffness, damping, air coefficients; no effects.

    Kernels always compute LANES individuals; unused lanes repeat the last genome.
    """
    column = {gene.name: k for k, gene in enumerate(genes)}
    padded = genomes[np.minimum(np.arange(LANES), len(genomes) - 1)]

    def value(name: str) -> Array:
        return padded[:, column[name]]

    # rods: E_r I_r in bending (rotations), G_r A_r across (translations), thesis Eqs. 15-16
    foam, rod, lost = (
        np.array([value(along), value(across)]) for along, across in (("E_f", "G_f"), ("E_r", "G_r"), ("D_E", "D_G"))
    )
    stiffness = spring_constants(structure.connectors, foam, rod)
    damping = np.array([c.foam[:, None] * lost[list(c.modulus)] for c in structure.connectors])
    shares, places, hinge = {}, {}, structure.wing.hinge
    for prefix in ("L", "ID"):
        weights = np.array([value(f"{prefix}_{k}") for k in range(1, QUARTERS + 1)])
        shares[prefix], places[prefix] = _distribute(structure, weights / weights.sum(axis=0))
    return Lanes(
        stiffness=aligned(stiffness), damping=aligned(damping),
        coefficients=aligned([value(name) for name in ("L_a", "L_b", "ID_a", "ID_b")]),
        lift_share=aligned(shares["L"]), lift_x=aligned(places["L"]),
        drag_share=aligned(shares["ID"]), drag_x=aligned(places["ID"]),
        hinge=aligned(np.repeat([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, hinge.y, hinge.z], LANES).reshape(9, LANES)),
        coupling=np.zeros((0, 9, LANES)), pairs=np.zeros((0, 3), np.int64), masses=np.zeros((0, 36, LANES)),
        weighing=0, laws=NO_LAWS,
    )  # fmt: skip


def _distribute(structure: Structure, quarters: Array) -> tuple[Array, Array]:
    """Share [N, W] of the strip's force that acts on each of N bodies, and its x [N, W] in the body's frame, m.

    ``quarters`` [4, W]: share of the force on each quarter of the chord, for W individuals. A body carries the part of
    each quarter that it covers, at the middle of that part.
    """
    share, moment = np.zeros((len(structure.panels), LANES)), np.zeros((len(structure.panels), LANES))
    for body, quarter, width, x in structure.stretches:
        part = quarters[quarter] * width * QUARTERS
        share[body] += part
        moment[body] += part * x
    return share, moment / share
