"""What a diagnosis needs of a rig.

The two known rigs are adapted in :mod:`wingfit.diagnosis.rigs`; any other rig that meets :class:`Subject` works as
well.
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
    """An effect that is considered as missing: physics, or a fault of the measurement, that can be added to the model.

    Attributes:
        name: by which :meth:`Subject.extended` adds it.
        title: display name.
        family: kind of physics, or "measurement".
        genes: those it adds; with all sizes at zero it is exactly off.
        size_genes: names of the genes that are its size.
        typical: values of all its genes for an effect as large as in practice.
        source: reference of its law.
        signature: what it looks like in a recording.
        location_genes: names of the genes that give its location along "span" and "chord" (0 to 1), if any.
        confused_with: names of suspects that look similar.
        candidate_shapes: values of its shape genes that are tried; empty means that the screening chooses them.
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
        """Names of the genes that are not its size."""
        return tuple(gene.name for gene in self.genes if gene.name not in self.size_genes)


class ChannelLocation(NamedTuple):
    """Where a channel is measured: marker or force axis ``name``, direction ``axis`` ("x", "y", "z"), location.

    ``span`` and ``chord`` from 0 to 1, ``x`` and ``y`` in m; None for a force.
    """

    name: str
    axis: str
    span: float | None = None
    chord: float | None = None
    x: float | None = None
    y: float | None = None


class Subject(Protocol):
    """The rig under diagnosis: its nominal model, the suspects, finer models, and where its channels are measured."""

    @property
    def model(self) -> Model:
        """The nominal model."""
        ...

    @property
    def suspects(self) -> tuple[Suspect, ...]:
        """All effects that can be added."""
        ...

    @property
    def outline(self) -> tuple[tuple[float, float], ...]:
        """Outline of the wing, (x, y) in m, closed; empty where there is nothing to draw."""
        ...

    @property
    def description(self) -> str:
        """The nominal model in one line for the user."""
        ...

    def extended(self, names: Sequence[str]) -> Model:
        """The nominal model with the named suspects added; their genes follow its own and are off."""
        ...

    def with_initial_motion(self, model: Model, genome: Array) -> Model:
        """``model``, whose search for the periodic motion starts from the motion of ``genome`` [G]."""
        ...

    def finer_subjects(self) -> Sequence[Subject]:
        """The subject with finer discretisations, cheapest first; empty where there is none or its cost is too high."""
        ...

    def channel_locations(self, recording: Recording) -> tuple[ChannelLocation, ...]:
        """Where each channel of ``recording`` is measured."""
        ...

    def beat_start_phase(self, recording: Recording) -> float:
        """Phase 2 pi f t (rad) of ``recording`` at which a beat starts."""
        ...

    def simulated_recording(self, model: Model, genome: Array, condition: Condition) -> Recording | None:
        """What the rig would record of ``model`` with ``genome`` [G] under ``condition``; None if that fails."""
        ...

    def probe_responses(self, genome: Array, recording: Recording, probe: Probe) -> Probed | None:
        """Responses of the nominal model with ``genome`` [G] to unit loads; None for a rig that cannot be probed."""
        ...

    def candidate_conditions(self) -> tuple[Condition, ...]:
        """Conditions that the rig can run and that could be recorded next."""
        ...
