"""Hidden aerodynamic effects that the diagnosis can name, but simulates by other equations.

The equations are in ``wing/air_loads.py``. "The library" is the set of effects that the diagnosis can name.
"""

from __future__ import annotations

from dataclasses import replace

from benchmarks.concealed.plant.wing.build import GAS, Draft
from benchmarks.concealed.plant.wing.rig import (
    CARRIED,
    LAG,
    LAG_RATE,
    PLATE,
    SKIN,
    STALL,
    STALL_ANGLE,
    STALL_DELAY,
    TURNING,
    VORTEX,
    VORTEX_ANGLE,
)
from benchmarks.concealed.plant.wing_effects.kind import Kind, Values
from wingfit.records import Wing


def _carried(draft: Draft, strength: float, _: Values) -> None:
    draft.air_laws[CARRIED] = strength


def _carried_genes(_: Wing, strength: float, __: Values) -> dict[str, float]:
    return {"added_mass.k": strength}


def _dense(draft: Draft, strength: float, _: Values) -> None:
    """Let the pressure gauge read too low, by the pressure that ``strength`` (kg/m^3) of air has at 293 K."""
    condition = draft.condition
    draft.condition = replace(condition, pressure=condition.pressure + strength * GAS * _ROOM)


def _dense_genes(_: Wing, strength: float, __: Values) -> dict[str, float]:
    return {"residual_air.density": strength}


def _turning(draft: Draft, strength: float, _: Values) -> None:
    draft.air_laws[TURNING] = strength


def _flat(draft: Draft, strength: float, _: Values) -> None:
    draft.air_laws[PLATE] = strength


def _flat_genes(_: Wing, strength: float, __: Values) -> dict[str, float]:
    return {"plate_drag.coefficient": strength}


def _rough(draft: Draft, strength: float, _: Values) -> None:
    """Set the factor of Re^(-1/5) for both faces, times the kinematic viscosity (m^2/s) to the power 1/5.

    Viscosity by the power law of White, Viscous Fluid Flow (2006), Eq. 1-35.
    """
    air = draft.condition
    kinematic = 1.716e-5 * (air.temperature / 273.15) ** 0.666 * GAS * air.temperature / air.pressure
    draft.air_laws[SKIN] = strength * 2.0 * 0.074 * kinematic**0.2


def _vortex(draft: Draft, strength: float, at: Values) -> None:
    draft.air_laws[[VORTEX, VORTEX_ANGLE]] = strength, at["angle"]


def _late(draft: Draft, strength: float, at: Values) -> None:
    draft.air_laws[[LAG, LAG_RATE]] = strength, at["rate"]


def _stall(draft: Draft, strength: float, at: Values) -> None:
    draft.air_laws[[STALL, STALL_ANGLE, STALL_DELAY]] = strength, at["angle"], at["delay"]


_ROOM = 293.15  # K

LISTED_AIR = (
    Kind(
        "residual_air", "aerodynamics", True, "kg/m^3", 0.08, 0.1,
        "a gauge that reads too low by the same pressure; the library changes the density", _dense,
        genes=_dense_genes,
    ),
    Kind(
        "rotational_circulation", "aerodynamics", True, "1", 1.0, 2.5,
        "angle of attack at three quarters of the chord (Pistolesi 1929), in proportion to the lift slope; the "
        "library has a coefficient of its own", _turning,
    ),
    Kind(
        "plate_drag", "aerodynamics", True, "1", 0.5, 2.0,
        "cross-flow (Hoerner 1965, ch. III) at the centroid of each body; the library integrates over the chord",
        _flat, genes=_flat_genes,
    ),
    Kind(
        "viscous_drag", "aerodynamics", True, "1", 2.0, 20.0,
        "turbulent friction, 0.074 Re^(-1/5) (Prandtl 1927); the library has a laminar boundary layer", _rough,
    ),
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
