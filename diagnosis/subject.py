"""The interface between a diagnosis and a rig: what a diagnosis must know of a rig.

:mod:`wingfit.diagnosis.rigs` implements it for a wing, a vehicle, and a rig that the user simulates.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol, cast

from wingfit.records import Condition, Recording
from wingfit.records.array_types import Array
from wingfit.rigs.suspect import Suspect
from wingfit.sim.effects.probe import Probe
from wingfit.sim.model import Model
from wingfit.sim.wing.probing import Probed


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
    """The rig that is diagnosed: nominal model, suspects, and finer discretisations."""

    @property
    def model(self) -> Model:
        """The nominal model: the simulation before any suspect is added."""
        ...

    @property
    def suspects(self) -> tuple[Suspect, ...]:
        """All effects that :meth:`extended` can add."""
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
        """Return the rig with finer discretisations, as they are tried; empty if none exists or all are too costly."""
        ...


class BeatSubject(Subject, Protocol):
    """A rig that flaps: it also knows the beat, where on a wing channels are measured, and what could be recorded."""

    @property
    def outline(self) -> tuple[tuple[float, float], ...]:
        """Outline of the wing from above, a closed polygon of (x, y) in m; empty if there is nothing to draw."""
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


def beat_subject(subject: Subject) -> BeatSubject:
    """Return ``subject``, a rig with a beat; TypeError for another."""
    if not hasattr(subject, "beat_start_phase"):
        raise TypeError(f"{subject.description} has no beat")
    return cast("BeatSubject", subject)


def select_suspects(subject: Subject, names: Sequence[str]) -> list[Suspect]:
    """Return the suspects of ``subject`` with these ``names``, all if empty; ValueError for an unknown one."""
    known = {suspect.name: suspect for suspect in subject.suspects}
    for name in names:
        if name not in known:
            raise ValueError(f"unknown suspect {name!r}: remove it; this rig has {', '.join(known)}")
    return [suspect for name, suspect in known.items() if not names or name in names]
