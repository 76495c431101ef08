"""Description of a wing: planform, materials, rods, markers, hinge and drive. SI units, radians."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from wingfit.records.drive import Drive

Structure = Literal["sheet", "rigid"]


@dataclass(frozen=True)
class Station:
    """Section of the planform at the span position ``y``: x of the leading edge, chord and thickness, all in m."""

    y: float
    leading_edge: float
    chord: float
    thickness: float


@dataclass(frozen=True)
class Rod:
    """Carbon rod that slides in a straw glued into the foam, straight from (x_root, y_root) to (x_tip, y_tip), in m.

    ``density`` (kg/m^3) is that of the rod; straw and glue add ``glue_linear_density`` (kg/m). A driven rod continues
    beyond the root as the driving rod that the drive turns.
    """

    name: str
    x_root: float
    y_root: float
    x_tip: float
    y_tip: float
    diameter: float
    density: float
    glue_linear_density: float


@dataclass(frozen=True)
class Materials:
    """Densities of the wing, which no calibration searches: foam (kg/m^3), skin and its glue (kg/m^2, both faces).

    The areal density of the wing, without rods and markers, is foam density times thickness plus that of the skin.
    """

    foam_density: float
    skin_areal_density: float


@dataclass(frozen=True)
class Marker:
    """Tracked marker: rest position (x, y, z) in m in the wing frame, and mass in kg."""

    name: str
    position: tuple[float, float, float]
    mass: float


@dataclass(frozen=True)
class Hinge:
    """Axis about which the wing flaps: parallel to x, through the point (y, z), in m in the wing frame."""

    y: float
    z: float


@dataclass(frozen=True)
class Wing:
    """A wing: all inputs of a model that are not genes.

    ``stations`` are sections from root to tip, linear in between. ``driven_rods`` are the names of the front and
    the rear rod; the rear rod lags by the condition's phase lag. ``reference_markers`` define the start of the beat:
    where their mean height crosses that of the hinge on the upstroke (van der Grinten's thesis, IV-A). ``estimates``
    are the user's estimates of genes by name, overriding the model's defaults.

    ``structure`` is None for a wing of foam and rods. A "sheet" has no rods: it is elastic over its thickness, and the
    drive holds its root chord. A "rigid" wing has no rods either and turns as a whole with the drive.
    """

    name: str
    stations: tuple[Station, ...]
    materials: Materials
    rods: tuple[Rod, ...]
    driven_rods: tuple[str, ...]
    markers: tuple[Marker, ...]
    reference_markers: tuple[str, ...]
    hinge: Hinge
    drive: Drive
    estimates: Mapping[str, float] = field(default_factory=dict)
    structure: Structure | None = None

    @property
    def span(self) -> float:
        """Distance from the root station to the tip station, m."""
        return self.stations[-1].y - self.stations[0].y

    def marker(self, name: str) -> Marker:
        """Return the marker called ``name``; ValueError if there is none."""
        for marker in self.markers:
            if marker.name == name:
                return marker
        raise ValueError(f"no marker {name!r} on wing {self.name!r}; it has {', '.join(m.name for m in self.markers)}")
