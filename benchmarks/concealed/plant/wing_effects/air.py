"""Hidden aerodynamic effects that the diagnosis can name, but simulates by other equations.

The equations are in ``wing/air_loads.py``. "The library" is the set of effects that the diagnosis can name.
"""

from __future__ import annotations

from benchmarks.concealed.plant.wing.build import Draft
from benchmarks.concealed.plant.wing.rig import (
    CARRIED,
    LAG,
    LAG_RATE,
    STALL,
    STALL_ANGLE,
    STALL_DELAY,
    VORTEX,
    VORTEX_ANGLE,
)
from benchmarks.concealed.plant.wing_effects.kind import Kind, Values
from wingfit.records import Wing


def _carried(draft: Draft, strength: float, _: Values) -> None:
    draft.air_laws[CARRIED] = strength


def _carried_genes(_: Wing, strength: float, __: Values) -> dict[str, float]:
    return {"added_mass.k": strength}


def _vortex(draft: Draft, strength: float, at: Values) -> None:
    draft.air_laws[[VORTEX, VORTEX_ANGLE]] = strength, at["angle"]


def _late(draft: Draft, strength: float, at: Values) -> None:
    draft.air_laws[[LAG, LAG_RATE]] = strength, at["rate"]


def _stall(draft: Draft, strength: float, at: Values) -> None:
    draft.air_laws[[STALL, STALL_ANGLE, STALL_DELAY]] = strength, at["angle"], at["delay"]


LISTED_AIR = (
    Kind(
        "added_mass", "aerodynamics", True, "1", 1.0, 3.0,
        "elliptic sections by strips (Munk 1924), each rigid; the library adds chordwise modes", _carried,
        genes=_carried_genes,
    ),
    Kind(
        "leading_edge_vortex", "aerodynamics", True, "1", 0.7, 1.0,
        "lift and drag as fitted by Dickinson, Lehmann and Sane (1999); the library has C_l sin 2 alpha", _vortex,
        shape={"angle": (0.2, 0.1, 0.35)},
    ),
    Kind(
        "circulation_lag", "aerodynamics", True, "1", 1.0, 1.9,
        "Wagner's deficit of the downwash, by W. P. Jones (1945); the library delays the circulation", _late,
        shape={"rate": (1.0, 0.6, 1.6)},
    ),
    Kind(
        "dynamic_stall", "aerodynamics", True, "1", 0.8, 1.0,
        "Leishman and Beddoes (1989): two lags before Kirchhoff's law; the library has Goman and Khrabrov",
        _stall, shape={"angle": (0.35, 0.25, 0.5), "delay": (1.0, 0.5, 2.5)},
    ),
)  # fmt: skip
