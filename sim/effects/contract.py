"""What every effect declares, and the three places where it may act: a wing, a vehicle, an observation.

An effect has a size: parameters of which zero switches it off exactly. Its other parameters say where it acts and how;
they have no meaning at size zero. All become genes, which a calibration searches like any other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from wingfit.records import Gene, Vehicle, Wing
from wingfit.records.genes import Scale
from wingfit.sim.wing.planform import wing_mass

if TYPE_CHECKING:
    from wingfit.sim.effects.ports.observation import Sampling
    from wingfit.sim.effects.ports.vehicle import VehicleScene
    from wingfit.sim.effects.ports.wing import WingScene

Array = npt.NDArray[np.float64]
Family = Literal["structure", "inertia", "actuation", "aerodynamics", "measurement"]
Port = Literal["inertia", "connector", "point", "drive", "air", "observation"]
Power = Literal["conservative", "dissipative", "any"]
Measure = Literal["span", "chord", "mass"]
RigKind = Literal["wing", "vehicle"]
Values = Mapping[str, Array]  # parameters of one effect by name, one value per individual


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    Attributes:
        name: short; the gene is called EFFECT.NAME.
        unit: of the gene; "1" without dimension.
        lower, upper: bounds, in ``unit`` or, where ``of`` is given, in parts of that measure of the rig.
        typical: a size that is met in practice; of the other parameters, their nominal value. As the bounds.
        description: what it is.
        of: the measure of the rig that bounds and typical value are parts of: its span (m), its mean chord (m) or the
            mass of the wing (kg).
        place: whether it says where on the wing the effect acts.
        scale: how a search spreads over the bounds.
    """

    name: str
    unit: str
    lower: float
    upper: float
    typical: float
    description: str
    of: Measure | None = None
    place: bool = False
    scale: Scale = "linear"


@dataclass(frozen=True)
class Effect:
    """One piece of physics, or one fault of a measurement.

    Attributes:
        name: of the file as well, and of the page docs/effects/NAME.md.
        title: for people.
        family: what kind of thing it is.
        port: where it enters the model.
        size: zero of all of these switches it off exactly.
        shape: the other parameters.
        power: what its own law does with energy: "conservative" only keeps it (over a beat it gives and takes none),
            "dissipative" takes some at every instant, "any" promises nothing: it gives energy, or changes what the
            wing's other laws take. Of the air both promises hold in still air only: a stream pushes.
        memory: its internal states in words; empty where it has none.
        source: where the law is from (author, year, equation).
        signature: one line: what it looks like in a recording.
        confused_with: names of effects that look alike.
        wing, vehicle: what it does to a scene before it is simulated; None where it does not apply.
        observe: what it does to a simulated beat on its way into the recording; None where nothing.
        observed: kinds of recording that ``observe`` acts on.
    """

    name: str
    title: str
    family: Family
    port: Port
    size: tuple[Parameter, ...]
    source: str
    signature: str
    confused_with: tuple[str, ...]
    shape: tuple[Parameter, ...] = ()
    power: Power = "any"
    memory: str = ""
    wing: Callable[[WingScene, Values], None] | None = None
    vehicle: Callable[[VehicleScene, Values], None] | None = None
    observe: Callable[[Sampling, Values], None] | None = None
    observed: tuple[Literal["tracks", "forces"], ...] = ()

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All: sizes, then the others."""
        return (*self.size, *self.shape)

    @property
    def rigs(self) -> tuple[RigKind, ...]:
        """Whose models can contain it."""
        on_wing = self.wing is not None or "tracks" in self.observed
        on_vehicle = self.vehicle is not None or "forces" in self.observed
        both: tuple[tuple[RigKind, bool], ...] = (("wing", on_wing), ("vehicle", on_vehicle))
        return tuple(rig for rig, acts in both if acts)

    def applies_to(self, rig: Wing | Vehicle) -> bool:
        """Whether a model of ``rig`` can contain it."""
        return ("wing" if isinstance(rig, Wing) else "vehicle") in self.rigs

    def genes(self, rig: Wing | Vehicle) -> tuple[Gene, ...]:
        """Genes for ``rig``: switched off, all else at its typical value."""
        return tuple(self._gene(parameter, rig) for parameter in self.parameters)

    def typical(self, rig: Wing | Vehicle) -> dict[str, float]:
        """Values of the genes for ``rig`` at which the effect is as large as it is met in practice."""
        return {f"{self.name}.{p.name}": p.typical * measure(rig, p.of) for p in self.parameters}

    def values(self, genes: tuple[Gene, ...], genomes: Array) -> dict[str, Array]:
        """Parameters by their short names [B], from ``genomes`` [B, G] in the order of ``genes``."""
        column = {gene.name: k for k, gene in enumerate(genes)}
        return {p.name: genomes[:, column[f"{self.name}.{p.name}"]] for p in self.parameters}

    def off(self, values: Values) -> npt.NDArray[np.bool_]:
        """Which individuals [B] it is switched off for."""
        return np.asarray(np.all([values[p.name] == 0.0 for p in self.size], axis=0))

    def _gene(self, parameter: Parameter, rig: Wing | Vehicle) -> Gene:
        unit = measure(rig, parameter.of)
        nominal = 0.0 if parameter in self.size else parameter.typical * unit
        lower, upper = parameter.lower * unit, parameter.upper * unit
        name = f"{self.name}.{parameter.name}"
        return Gene(name, parameter.unit, nominal, lower, upper, parameter.scale, parameter.description)


def measure(rig: Wing | Vehicle, of: Measure | None) -> float:
    """A length (m) or mass (kg) of ``rig``; 1 for None."""
    if of is None:
        return 1.0
    if of == "mass":
        return rig.wing_mass if isinstance(rig, Vehicle) else wing_mass(rig)
    if isinstance(rig, Vehicle):
        places, chords, span = [s.r for s in rig.stations], [s.chord for s in rig.stations], rig.span
    else:
        places, chords = [s.y for s in rig.stations], [s.chord for s in rig.stations]
        span = places[-1] - places[0]
    return span if of == "span" else float(np.trapezoid(chords, places)) / span
