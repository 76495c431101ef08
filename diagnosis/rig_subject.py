"""Prepare a rig that the user simulates for a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from wingfit.records.array_types import Array, Float
from wingfit.rigs.rig_model import RigModel
from wingfit.rigs.suspect import Suspect
from wingfit.sim.model import Model


@dataclass(frozen=True, eq=False)
class RigSubject:
    """A rig that the user simulates; ``model`` is nominal."""

    model: RigModel

    @property
    def suspects(self) -> tuple[Suspect, ...]:
        """The rig's own suspects, laws at its ports, and faults of its channels and inputs."""
        return self.model.suspects

    @property
    def description(self) -> str:
        """The nominal model in one line of text for the user."""
        return self.model.rig.description or f"the simulation of {self.model.rig.name}"

    def extended(self, names: Sequence[str]) -> RigModel:
        """Return the nominal model with the suspects ``names`` added, all off."""
        return self.model.with_effects(*names)

    def with_initial_motion(self, model: Model, genome: Float[Array, " G"]) -> Model:  # noqa: ARG002  # part of the protocol
        """Return ``model`` unchanged: its motion starts as its genes say."""
        return model

    def finer_subjects(self) -> tuple[RigSubject, ...]:
        """Return nothing: the accuracy of the simulation is the user's."""
        return ()
