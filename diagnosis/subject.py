"""The interface between a diagnosis and a rig: what a diagnosis must know of a rig.

:mod:`wingfit.diagnosis.rigs` implements it for the two known rigs; any other class that implements :class:`Subject`
works as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

from wingfit.records import Condition, Gene, Recording
from wingfit.records.array_types import Array
from wingfit.sim.effects.probe import Probe
from wingfit.sim.model import Model
from wingfit.sim.wing.probing import Probed

Family = Literal["structure", "inertia", "actuation", "aerodynamics", "measurement"]


@dataclass(frozen=True)
class Suspect:
    """An effect that may be missing in the model: physics, or a fault of the measurement, that can be added to it.

    Attributes:
        name: identifier with which :meth:`Subject.extended` adds the effect.
        title: display name.
        family: kind of physics, or "measurement".
        genes: the genes that the effect adds to the model; with all size genes at zero the effect is exactly off.
        size_genes: names of those of ``genes`` that say how strong the effect is.
        typical: value of each of ``genes`` for an effect as strong as in practice.
        source: reference of its law.
        signature: what the effect looks like in a recording, as text for the user.
        location_genes: names of the genes that give its location along "span" and "chord" (0 to 1); empty if it has
            none.
        confused_with: names of suspects that look similar in a recording.
        candidate_shapes: values of the shape genes (:attr:`shape_genes`), a tuple for each trial of the score test;
            empty means that the score test spreads its own trials.
    """

    name: str
    title: str
    family: Family
    genes: tuple[Gene, ...]
    size_genes: tuple[str, ...]
    typical: Mapping[str, float]
    source: str
    signature: str
    location_genes: Mapping[Literal["span", "chord"], str]
    confused_with: tuple[str, ...] = ()
    candidate_shapes: tuple[tuple[float, ...], ...] = ()

    @property
    def shape_genes(self) -> tuple[str, ...]:
        """Names of the genes that are not sizes, such as the location."""
        return tuple(gene.name for gene in self.genes if gene.name not in self.size_genes)


class ChannelLocation(NamedTuple):
    """Where one channel is measured: a coordinate of a marker, or a force.

    ``name`` of the marker or force axis; ``axis``: direction "x", "y" or "z"; ``span`` (from the root) and ``chord``
    (from the leading edge), fractions 0 to 1; ``x`` and ``y``: position at rest, m. The last four are None for a force.
    """

    name: str
    axis: str
    span: float | None = None
    chord: float | None = None
    x: float | None = None
    y: float | None = None


class Subject(Protocol):
    """The rig that is diagnosed: nominal model, suspects, finer discretisations, and where channels are measured."""

    @property
    def model(self) -> Model:
        """The nominal model: the simulation before any suspect is added."""
        ...

    @property
    def suspects(self) -> tuple[Suspect, ...]:
        """All effects that :meth:`extended` can add."""
        ...

    @property
    def outline(self) -> tuple[tuple[float, float], ...]:
        """Outline of the wing from above, a closed polygon of (x, y) in m; empty if there is nothing to draw."""
        ...

    @property
    def description(self) -> str:
        """The nominal model in one line of text for the user."""
        ...

    def extended(self, names: Sequence[str]) -> Model:
        """Return the nominal model with the suspects ``names`` added, all off; their genes follow the model's own."""
        ...

    def with_initial_motion(self, model: Model, genome: Array) -> Model:
        """Return ``model`` such that its search for the periodic motion starts at the motion of ``genome`` [G]."""
        ...

    def finer_subjects(self) -> Sequence[Subject]:
        """Return the rig with finer discretisations, cheapest first; empty if none exists or all are too costly."""
        ...

    def channel_locations(self, recording: Recording) -> tuple[ChannelLocation, ...]:
        """Return where each channel of ``recording`` is measured, in the order of its channels."""
        ...

    def beat_start_phase(self, recording: Recording) -> float:
        """Return the phase 2 pi f t (rad; f flap frequency, t time in ``recording``) at which a beat starts."""
        ...

    def simulated_recording(self, model: Model, genome: Array, condition: Condition) -> Recording | None:
        """Return what the rig would record of ``model`` with ``genome`` [G] under ``condition``; None if that fails."""
        ...

    def probe_responses(self, genome: Array, recording: Recording, probe: Probe) -> Probed | None:
        """Return responses of the nominal model with ``genome`` [G] to unit loads; None if it cannot be probed."""
        ...

    def candidate_conditions(self) -> tuple[Condition, ...]:
        """Return conditions that the rig can run and that could be recorded next."""
        ...
