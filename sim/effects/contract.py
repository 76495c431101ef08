"""What every effect declares, and where it may act: on a wing, on a vehicle, or on an observation.

An effect has sizes: parameters that switch it off exactly where all of them are zero. Its other parameters describe
where on the wing it acts and how; they have no meaning while the effect is off. All parameters become genes, which a
calibration searches like any other.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Literal

import numpy as np

from wingfit.records import CameraPose, Gene, Vehicle, Wing
from wingfit.records.array_types import Array as Array
from wingfit.records.array_types import Mask
from wingfit.records.genes import Scale
from wingfit.sim.wing.planform import wing_mass

if TYPE_CHECKING:
    from wingfit.sim.effects.ports.observation import Sampling
    from wingfit.sim.effects.ports.vehicle import VehicleScene
    from wingfit.sim.effects.ports.wing import WingScene

Family = Literal["structure", "inertia", "actuation", "aerodynamics", "measurement"]
Port = Literal["inertia", "connector", "point", "drive", "air", "observation"]
Power = Literal["conservative", "dissipative", "any"]
Measure = Literal["span", "chord", "mass"]
RigKind = Literal["wing", "vehicle"]
Cameras = tuple[CameraPose, ...]  # which a dataset states; none if unknown
Values = Mapping[str, Array]  # parameters of one effect by name, one value per individual
FAMILIES: dict[Port, tuple[Family, ...]] = {
    "inertia": ("inertia", "aerodynamics"),
    "connector": ("structure", "actuation"),
    "point": ("structure", "actuation"),
    "drive": ("actuation",),
    "air": ("aerodynamics",),
    "observation": ("measurement",),
}
"""Families of effects that each port takes; loads of the air act through "air" or "inertia", to be counted as such."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    Attributes:
        name: short name; the gene is called EFFECT.NAME.
        unit: unit of the gene; "1" without dimension.
        lower, upper: bounds, in ``unit`` or, where ``of`` is given, as multiples of that measure of the rig.
        typical: a value met in practice if it is a size; for the other parameters, the nominal value. In the unit of
            the bounds.
        description: its meaning, for users.
        of: the measure of the rig that scales bounds and typical value: its span (m), its mean chord (m) or the mass of
            the wing (kg).
        place: whether the parameter is a position on the wing where the effect acts.
        wing_only: whether a vehicle does not have the parameter.
        vehicle_only: whether a wing does not have the parameter.
        positions: of a size that is a choice rather than an amount: the values that it can have besides zero. A fit may
            pass between them, and a diagnosis rejects what ends there. Empty: any value.
        scale: how a search spreads over the bounds, "linear" or "log".
        assumed: whether it places cameras that are assumed; with a dataset that states its cameras it is not there.
        vehicle_bounds: bounds of a vehicle's parameter, in the same unit; None where they are ``lower`` and ``upper``.
    """

    name: str
    unit: str
    lower: float
    upper: float
    typical: float
    description: str
    of: Measure | None = None
    place: bool = False
    wing_only: bool = False
    vehicle_only: bool = False
    positions: tuple[float, ...] = ()
    scale: Scale = "linear"
    assumed: bool = False
    vehicle_bounds: tuple[float, float] | None = None

    def bounds_of(self, rig: Wing | Vehicle) -> tuple[float, float]:
        """Return the bounds (unit of the gene) of the parameter on ``rig``."""
        own = self.vehicle_bounds if self.vehicle_bounds and isinstance(rig, Vehicle) else (self.lower, self.upper)
        return own[0] * measure(rig, self.of), own[1] * measure(rig, self.of)


@dataclass(frozen=True)
class Effect:
    """One piece of physics, or one fault of a measurement.

    ValueError if its port does not take its family (:data:`FAMILIES`), if ``observe`` or ``observed`` does not fit the
    port, or if its law names none of its sizes.

    Attributes:
        name: identifier; also the name of its file, and of its page docs/effects/NAME.md.
        title: name for users.
        family: kind of physics.
        port: the part of the model that it changes.
        size: parameters that switch it off exactly where all are zero.
        shape: the other parameters.
        power: energy exchange of its own law: "conservative": none is gained or lost over a beat; "dissipative": some
            is lost at every instant; "any": neither is guaranteed. In a stream, none of these is guaranteed for a law
            of the air.
        memory: its internal states in words; empty where it has none.
        law: its equations, one a line, with the names of its parameters; at least one of the sizes is among them.
        source: the publication of the law (author, year, equation).
        signature: one line: how it shows in a recording.
        confused_with: names of effects with a similar signature.
        wing, vehicle: functions that change the input of a simulation, a scene; None where the effect does not apply.
        term: term of a vehicle's model (:data:`wingfit.sim.vehicle.terms.TERMS`) that the effect is; it is for models
            without that term only. "" if it is none.
        during: whether its sizes are changes from the start of a recording to its end. Then ``wing`` is called with
            minus half of them for the start and with half of them for the end. The middle is without the effect, and
            in between the wing changes smoothly.
        of_term: term of a vehicle's model that the effect changes; it is for models with that term only. "" if it
            changes none.
        observe: function that changes a simulated beat before it is compared with a recording; only for the port
            "observation".
        observed: kinds of recording that ``observe`` acts on.
        of_rods: whether it needs a wing with rods.
        descriptive: whether it describes how coefficients differ between conditions, but not why.
    """

    name: str
    title: str
    family: Family
    port: Port
    size: tuple[Parameter, ...]
    law: str
    source: str
    signature: str
    confused_with: tuple[str, ...]
    shape: tuple[Parameter, ...] = ()
    power: Power = "any"
    memory: str = ""
    wing: Callable[[WingScene, Values], None] | None = None
    vehicle: Callable[[VehicleScene, Values], None] | None = None
    term: str = ""
    of_term: str = ""
    during: bool = False
    observe: Callable[[Sampling, Values], None] | None = None
    observed: tuple[Literal["tracks", "forces"], ...] = ()
    of_rods: bool = False
    descriptive: bool = False

    def __post_init__(self) -> None:
        if self.family not in FAMILIES[self.port]:
            raise ValueError(
                f"effect {self.name!r}: family {self.family!r} does not fit port {self.port!r}, which takes "
                f"{' or '.join(map(repr, FAMILIES[self.port]))}: change the family, or act through another port"
            )
        if self.during and (self.wing is None or self.vehicle is not None):
            raise ValueError(
                f"effect {self.name!r}: only the wing can change during a recording: give `wing` and no `vehicle`, or "
                "leave out `during`"
            )
        observing = self.port == "observation"
        if bool(self.observe) != observing or bool(self.observed) != observing:
            raise ValueError(
                f"effect {self.name!r} on port {self.port!r}: observe and observed belong to port 'observation', and "
                "both are needed there"
            )
        if "=" not in self.law or not {p.name for p in self.size} & set(re.findall(r"\w+", self.law)):
            raise ValueError(
                f"effect {self.name!r}: its law {self.law!r} must be an equation that names at least one of its sizes "
                f"{', '.join(p.name for p in self.size)}: write it with the names of the parameters"
            )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters: sizes, then shape parameters."""
        return (*self.size, *self.shape)

    @property
    def rigs(self) -> tuple[RigKind, ...]:
        """Kinds of rig (wing, vehicle) that the effect applies to."""
        on_wing = self.wing is not None or "tracks" in self.observed
        on_vehicle = self.vehicle is not None or "forces" in self.observed
        both: tuple[tuple[RigKind, bool], ...] = (("wing", on_wing), ("vehicle", on_vehicle))
        return tuple(rig for rig, acts in both if acts)

    def applies_to(self, rig: Wing | Vehicle) -> bool:
        """Return whether the effect applies to ``rig``.

        A rigid wing moves as the drive does: only effects of its motion and of the observation show, and no load.
        """
        if not isinstance(rig, Wing):
            return "vehicle" in self.rigs
        if rig.structure == "rigid" and (self.port not in ("drive", "observation") or (self.wing and self.memory)):
            return False
        return "wing" in self.rigs and not (self.of_rods and rig.structure is not None)

    def fits(self, terms: Collection[str]) -> bool:
        """Return whether the effect can be added to a vehicle's model of these ``terms``."""
        return self.term not in terms and (not self.of_term or self.of_term in terms)

    def parameters_of(self, rig: Wing | Vehicle, cameras: Cameras = ()) -> tuple[Parameter, ...]:
        """Return the parameters that the effect has on ``rig``, which the stated ``cameras`` filmed."""
        here = (p for p in self.parameters if not (p.vehicle_only if isinstance(rig, Wing) else p.wing_only))
        return tuple(p for p in here if not (p.assumed and cameras))

    def genes(self, rig: Wing | Vehicle, cameras: Cameras = ()) -> tuple[Gene, ...]:
        """Return the genes of all parameters for ``rig``: sizes nominally zero, the others at their typical values."""
        return tuple(self._gene(parameter, rig) for parameter in self.parameters_of(rig, cameras))

    def typical(self, rig: Wing | Vehicle, cameras: Cameras = ()) -> dict[str, float]:
        """Return the typical values of all genes for ``rig``, in their units, by the names of the genes."""
        return {f"{self.name}.{p.name}": p.typical * measure(rig, p.of) for p in self.parameters_of(rig, cameras)}

    def values(self, genes: tuple[Gene, ...], genomes: Array) -> dict[str, Array]:
        """Return the parameters [B] by their short names, from ``genomes`` [B, G], whose columns are ``genes``."""
        column = {gene.name: k for k, gene in enumerate(genes)}
        names = {p.name: f"{self.name}.{p.name}" for p in self.parameters}
        return {short: genomes[:, column[name]] for short, name in names.items() if name in column}

    def on(self, genes: tuple[Gene, ...], genomes: Array) -> Mask:
        """Return True [B] where any size of the effect is nonzero in ``genomes`` [B, G] with the columns ``genes``."""
        values = self.values(genes, genomes)
        return np.asarray(np.any([values[p.name] != 0.0 for p in self.size], axis=0))

    def _gene(self, parameter: Parameter, rig: Wing | Vehicle) -> Gene:
        unit = measure(rig, parameter.of)
        nominal = 0.0 if parameter in self.size else parameter.typical * unit
        lower, upper = parameter.bounds_of(rig)
        name = f"{self.name}.{parameter.name}"
        return Gene(name, parameter.unit, nominal, lower, upper, parameter.scale, parameter.description)


effect_of_joints = partial(Effect, family="structure", port="connector")
effect_of_drive = partial(Effect, family="actuation", port="drive")
effect_of_air = partial(Effect, family="aerodynamics", port="air")
fault_of_tracks = partial(Effect, family="measurement", port="observation", observed=("tracks",))
fault_of_forces = partial(Effect, family="measurement", port="observation", observed=("forces",))
fault_of_recordings = partial(Effect, family="measurement", port="observation", observed=("tracks", "forces"))


def place(station: float, chord: float) -> tuple[Parameter, Parameter]:
    """Return two parameters for an effect's position on the wing; arguments: typical fractions of span and chord."""
    along = "position along the span, as a fraction of the span from root to tip"
    across = "position along the chord, as a fraction of the chord from the leading edge"
    return (
        Parameter("station", "1", 0.0, 1.0, station, along, place=True),
        Parameter("chord", "1", 0.0, 1.0, chord, across, place=True),
    )


def measure(rig: Wing | Vehicle, of: Measure | None) -> float:
    """Return the measure ``of`` the rig that scales bounds of parameters: a length (m) or mass (kg); 1 for None."""
    if of is None:
        return 1.0
    if of == "mass":
        return rig.wing_mass if isinstance(rig, Vehicle) else wing_mass(rig)
    places = [s.r for s in rig.stations] if isinstance(rig, Vehicle) else [s.y for s in rig.stations]
    return rig.span if of == "span" else float(np.trapezoid([s.chord for s in rig.stations], places)) / rig.span
