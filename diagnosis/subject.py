"""What a diagnosis needs of a rig: a model that can be extended, the suspects, a finer model, and where channels lie.

The two rigs that are known are adapted in :mod:`wingfit.diagnosis.rigs`; any other that meets :class:`Subject` will do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from wingfit.records import Condition, Gene, Recording
from wingfit.sim.effects.probe import Probe
from wingfit.sim.model import Model
from wingfit.sim.wing.probing import Probed

Array = npt.NDArray[np.float64]
Family = Literal["structure", "inertia", "actuation", "aerodynamics", "measurement"]


@dataclass(frozen=True)
class Suspect:
    """A piece of physics, or a fault of the measurement, that the nominal model lacks and that may be put in.

    Attributes:
        name: by which :meth:`Subject.extended` puts it in.
        title: for people.
        family: physics, or "measurement".
        genes: those it adds; all sizes at zero switch it off exactly.
        sizes: names of the genes that are its size.
        places: names of genes that say where on the wing it acts: "span" and "chord" in parts, or nothing.
        typical: values of all its genes at which it is as large as it is met in practice.
        source: where its law is from.
        signature: what it looks like in a recording.
        alike: names of others that look like it.
        spots: values of its shapes that are tried, in their order, where it acts at these only; else any are.
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
    """Where a channel is measured: ``name`` of the marker or force axis, ``axis`` ("x", "y", "z"), place on the wing.

    ``span`` and ``chord`` in parts, ``x`` and ``y`` in m; None for a force.
    """

    name: str
    axis: str
    span: float | None = None
    chord: float | None = None
    x: float | None = None
    y: float | None = None


class Subject(Protocol):
    """A rig under diagnosis."""

    @property
    def model(self) -> Model:
        """The nominal model."""
        ...

    @property
    def suspects(self) -> tuple[Suspect, ...]:
        """All that may be put in."""
        ...

    @property
    def outline(self) -> tuple[tuple[float, float], ...]:
        """Outline of the wing, (x, y) in m, closed; empty where there is nothing to draw."""
        ...

    @property
    def description(self) -> str:
        """The model in words."""
        ...

    def extended(self, names: Sequence[str]) -> Model:
        """The nominal model with suspects put in; their genes follow its own, switched off."""
        ...

    def with_initial_motion(self, model: Model, genome: Array) -> Model:
        """``model``, told that individuals will be near ``genome`` [G], so that it may begin its search there."""
        ...

    def finer_subjects(self) -> Sequence[Subject]:
        """The same with finer divisions, cheapest first; none where there is none, or it would cost too much."""
        ...

    def channel_locations(self, recording: Recording) -> tuple[ChannelLocation, ...]:
        """Where each channel of ``recording`` is measured."""
        ...

    def beat_start_phase(self, recording: Recording) -> float:
        """Phase 2 pi f t (rad) of ``recording`` at which a beat begins."""
        ...

    def simulated_recording(self, model: Model, genome: Array, condition: Condition) -> Recording | None:
        """What ``model`` with ``genome`` [G] shows under ``condition``, recorded as the rig does; None if it fails."""
        ...

    def probe_responses(self, genome: Array, recording: Recording, probe: Probe) -> Probed | None:
        """What the nominal model with ``genome`` [G] answers to known loads; None for a rig that cannot be probed."""
        ...

    def candidate_conditions(self) -> tuple[Condition, ...]:
        """Conditions that the rig can run and that one might record next."""
        ...
