"""Uniform foam plates with known rods, and their linear statics."""

from __future__ import annotations

from dataclasses import replace

from benchmarks.physics.plates import displacement, loaded, plate, stiffness_matrix
from wingfit.records import Materials, Rod, Wing
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.structure import Structure, build

__all__ = ["cut", "displacement", "loaded", "plate", "stiffness_matrix", "straight_rod", "with_materials"]


def straight_rod(name: str, x: float, y_tip: float, diameter: float, density: float = 0.0, glue: float = 0.0) -> Rod:
    """A rod along the span from the root at y = 0."""
    return Rod(name, x, 0.0, x, y_tip, diameter, density, glue)


def cut(wing: Wing, division: str) -> Structure:
    """The wing divided into rigid bodies, such as "4" or "2x5"."""
    return build(wing, Division.parse(division))


def with_materials(wing: Wing, foam: float, skin: float) -> Wing:
    """The wing with foam of a density (kg/m^3) and skin (kg/m^2)."""
    return replace(wing, materials=Materials(foam, skin))
