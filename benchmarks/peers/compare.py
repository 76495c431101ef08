"""Processor time of one wing beat in each engine (scipy, Exudyn) at a given error against its own converged run."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Literal

import numpy as np

from benchmarks.peers import exudyn_engine, scipy_engine
from benchmarks.peers.wing import PeerWing, peer_wing
from wingfit.sim.virtual_rigs.campaign import robird_wing, tunnel, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing

Medium = Literal["air", "vacuum"]

CONDITIONS = {"vacuum": vacuum(10.0, 0.05, 3.0), "air": tunnel(0.05, 3.0, 6.0)}
CASES = ("scipy", "exudyn", "exudyn_same_law")


def nominal(division: str, medium: Medium) -> PeerWing:
    """Return the Robird's wing with nominal genes at 3 Hz, in the chamber at 10 mbar or in the tunnel at 6 m/s.

    ``division``: discretisation into bodies. ValueError for an unknown ``medium``.
    """
    if medium not in CONDITIONS:
        raise ValueError(f"medium {medium!r} is unknown; give one of {', '.join(CONDITIONS)}")
    model = FlexibleWing(robird_wing(), division)
    genome = np.array([gene.nominal for gene in model.genes])
    return peer_wing(model.structure, model.genes, genome, CONDITIONS[medium])


def scipy_case(division: str, medium: Medium, tolerance_mm: float, seconds: float = 600.0) -> dict[str, Any]:
    """Measure a beat with scipy: the cheapest of LSODA, BDF and Radau, on compiled equations, sparse Jacobian.

    Arguments and result as for :func:`case`.
    """
    return case("scipy", division, medium, tolerance_mm, seconds)


def exudyn_case(division: str, medium: Medium, tolerance_mm: float, seconds: float = 600.0) -> dict[str, Any]:
    """Measure a beat with Exudyn and its own compiled spring law. Arguments and result as for :func:`case`.

    In air, the compiled air loads are called from Python. In the vacuum chamber, whose pressure is 1 % of the ambient
    one, the simulation with Exudyn neglects the air, which avoids these calls.
    """
    return case("exudyn", division, medium, tolerance_mm, seconds)


def exudyn_same_law_case(division: str, medium: Medium, tolerance_mm: float, seconds: float = 600.0) -> dict[str, Any]:
    """Measure a beat with Exudyn and wingfit's spring law, which is called from Python and therefore slow.

    It serves to check that the results agree. Arguments and result as for :func:`case`.
    """
    return case("exudyn_same_law", division, medium, tolerance_mm, seconds)


def case(engine: str, division: str, medium: Medium, tolerance_mm: float, seconds: float) -> dict[str, Any]:
    """Return one row of the comparison: engine, number of bodies, medium, tolerance, and the fields of Cost.

    ``engine``: one of CASES; ``division``: discretisation into bodies; ``tolerance_mm``: largest error of a marker;
    ``seconds``: time limit.
    """
    if engine not in CASES:
        raise ValueError(f"engine {engine!r} is unknown; give one of {', '.join(CASES)}")
    if not tolerance_mm > 0:
        raise ValueError(f"tolerance is {tolerance_mm:g} mm; it must be above 0 mm")
    wing = nominal(division, medium)
    if engine == "scipy":
        cost = scipy_engine.cheapest(wing, tolerance_mm, seconds=seconds)
    else:
        wing = wing._replace(air=0.0) if medium == "vacuum" else wing
        law: exudyn_engine.Law = "energy" if engine == "exudyn_same_law" else "angles"
        cost = exudyn_engine.cheapest(wing, tolerance_mm, law=law, seconds=seconds)
    head = {"engine": engine, "bodies": len(wing.mass), "medium": medium, "tolerance_mm": tolerance_mm}
    return head | asdict(cost)
