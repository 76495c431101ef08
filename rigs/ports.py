"""Laws that may act at a port of a rig: a coordinate and its rate, where the rig accepts an additional force.

A port's force is added to the force on the coordinate; it is zero, exactly, while all sizes are zero. Force and
coordinate are general: torque and angle, voltage and charge.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wingfit.records import Gene
from wingfit.rigs.suspect import Suspect

SMOOTH = 0.02  # of the port's rate: dry friction has 3/4 of its force at this rate
WIDEST = 0.5  # of the port's coordinate: largest play, and largest distance in which a hysteresis builds up
PUSHES = 0.1  # of its largest value: a friction may seem to drive the coordinate by as much, when others are wrong
LEAST_TYPICAL, MOST_TYPICAL = 1e-60, 1e60  # of coordinate, rate and force: their cubes are finite
Values = Mapping[str, float]


@dataclass(frozen=True)
class Port:
    """Where a rig accepts an additional force.

    Attributes:
        name: identifier, which the simulation passes to :meth:`wingfit.rigs.run.Run.force`.
        coordinate_unit, force_unit: units of the coordinate and of the force.
        coordinate, rate, force: typical largest values of coordinate, rate (coordinate_unit/s) and force; they set the
            bounds of the laws, whose force at these values is at most ``force``.
        stiffness: gene that is the stiffness (force_unit/coordinate_unit) of the spring that acts on this coordinate,
            which may have play; "" if there is none.
    """

    name: str
    coordinate_unit: str
    force_unit: str
    coordinate: float
    rate: float
    force: float
    stiffness: str = ""

    def __post_init__(self) -> None:
        for name in ("coordinate", "rate", "force"):
            value = getattr(self, name)
            if not LEAST_TYPICAL <= value <= MOST_TYPICAL:
                raise ValueError(
                    f"port {self.name!r}: its typical {name} is {value:g}; give a positive number from "
                    f"{LEAST_TYPICAL:g} to {MOST_TYPICAL:g}"
                )


class Law(NamedTuple):
    """A law at a port.

    Attributes:
        suspect: its genes and how it is presented.
        force: of (gene values, coordinate, rate, internal state), in the port's unit.
        slip: rate (1/s) of the internal state, which starts at zero; None for a law without memory.
    """

    suspect: Suspect
    force: Callable[[Values, float, float, float], float]
    slip: Callable[[Values, float, float, float], float] | None = None


def laws(port: Port) -> dict[str, Law]:
    """Return the laws of ``port`` by the names of their suspects."""
    found = [*_proportional(port), _hysteresis(port), *([_play(port)] if port.stiffness else [])]
    return {law.suspect.name: law for law in found}


def _proportional(port: Port) -> Iterator[Law]:
    """Yield the laws whose force is a size times a fixed function of coordinate and rate."""
    q, v, f = port.coordinate, port.rate, port.force
    force, rate, slow = port.force_unit, f"({port.coordinate_unit}/s)", SMOOTH * port.rate
    along = port.coordinate_unit
    rows: tuple[tuple[str, str, float, float, str, str, Callable[[float, float], float]], ...] = (
        # name, title, lower bound over upper, upper bound, unit, source, force for a size of one
        ("dry_friction", "dry friction", -PUSHES, f, force, "Coulomb 1785", lambda _, y: -float(np.tanh(y / slow))),
        ("viscous", "viscous damping", -1.0, f / v, f"{force}/{rate}", "linear damper", lambda _, y: -y),
        ("square_drag", "drag with the square of the rate", -1.0, f / v**2, f"{force}/{rate}^2", "Newton 1687",
         lambda _, y: -abs(y) * y),
        ("stiffness", "additional spring", -1.0, f / q, f"{force}/{along}", "Hooke 1678", lambda x, _: -x),
        ("square_stiffness", "quadratic stiffness", -1.0, f / q**2, f"{force}/{along}^2",
         "Nayfeh and Mook 1979, chapter 2", lambda x, _: -x * x),
        ("cubic_stiffness", "cubic stiffness", -1.0, f / q**3, f"{force}/{along}^3", "Duffing 1918",
         lambda x, _: -x * x * x),
        ("constant_force", "constant force", -1.0, f, force, "equilibrium", lambda _x, _y: 1.0),
    )  # fmt: skip
    for name, title, low, high, unit, source, shape in rows:
        name, title = f"{name}.{port.name}", f"{title} at {port.name}"
        size = Gene(f"{name}.size", unit, 0.0, low * high, high, "linear", title)
        yield Law(Suspect(name, title, "physics", (size,), source=source), _scaled(size.name, shape))


def _scaled(size: str, shape: Callable[[float, float], float]) -> Callable[[Values, float, float, float], float]:
    return lambda values, coordinate, rate, _: values[size] * shape(coordinate, rate)


def _play(port: Port) -> Law:
    """Return the law that takes away the force of the port's spring within a gap: a dead zone."""
    name = f"play.{port.name}"
    gap = Gene(f"{name}.gap", port.coordinate_unit, 0.0, 0.0, WIDEST * port.coordinate, "linear", "half the play")

    def force(values: Values, coordinate: float, rate: float, state: float) -> float:  # noqa: ARG001
        half = values[gap.name]
        return values[port.stiffness] * min(max(coordinate, -half), half)

    return Law(
        Suspect(name, f"play at {port.name}", "physics", (gap,), source="dead zone; Nordin and Gutman 2002"), force
    )


def _hysteresis(port: Port) -> Law:
    """Return Dahl's law: a friction that builds up over a distance; its state is the part that has built up."""
    name, q = f"hysteresis.{port.name}", port.coordinate
    size = Gene(
        f"{name}.force", port.force_unit, 0.0, -PUSHES * port.force, port.force, "linear", "force of hysteresis"
    )
    reach = Gene(
        f"{name}.reach", port.coordinate_unit, 0.1 * q, 0.005 * q, WIDEST * q, "log", "distance in which it builds up"
    )

    def force(values: Values, coordinate: float, rate: float, state: float) -> float:  # noqa: ARG001
        return -values[size.name] * state

    def slip(values: Values, coordinate: float, rate: float, state: float) -> float:  # noqa: ARG001
        return (rate - abs(rate) * state) / values[reach.name]

    suspect = Suspect(name, f"hysteresis at {port.name}", "physics", (size, reach), source="Dahl 1968")
    return Law(suspect, force, slip)
