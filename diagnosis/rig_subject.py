"""Prepare a rig that the user simulates for a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from wingfit.records import SeriesDataset
from wingfit.records.array_types import Array, Float
from wingfit.rigs.rig import Rig
from wingfit.rigs.rig_model import RigModel
from wingfit.rigs.suspect import Suspect
from wingfit.sim.model import Model


@dataclass(frozen=True, eq=False)
class RigSubject:
    """A rig that the user simulates; ``model`` is nominal."""

    model: RigModel

    @classmethod
    def of(cls, rig: Rig, dataset: SeriesDataset) -> RigSubject:
        """Return ``rig`` for the recordings of ``dataset``; ValueError where they do not fit together."""
        check_fits(rig, dataset)
        channels = {one.name: rig.channels[one.name] for one in dataset.channels}
        return cls(RigModel(replace(rig, channels=channels), dataset.recordings))

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


def check_fits(rig: Rig, dataset: SeriesDataset) -> None:
    """Raise ValueError if channels, inputs, settings or units of ``dataset`` are not those of ``rig``."""
    for what, wanted, stated in (
        ("channel", rig.channels, {one.name: one.unit for one in dataset.channels}),
        ("input", rig.inputs, {one.name: one.unit for one in dataset.inputs}),
        ("setting", rig.settings, {one.name: one.unit for one in dataset.settings}),
    ):
        for name, unit in stated.items():
            if what == "channel" and name not in wanted:
                raise ValueError(
                    f"dataset {dataset.name!r} has a channel {name!r}, which rig {rig.name!r} does not simulate; it "
                    f"has {', '.join(wanted)}: remove the channel, or simulate it"
                )
            if name in wanted and unit != wanted[name]:
                raise ValueError(
                    f"{what} {name!r} is in {unit!r} in dataset {dataset.name!r}, but in {wanted[name]!r} in rig "
                    f"{rig.name!r}; convert one of them"
                )
        missing = [name for name in wanted if name not in stated]
        if missing and what != "channel":
            raise ValueError(f"rig {rig.name!r} needs the {what} {missing[0]!r}, but dataset {dataset.name!r} has none")
    own = [gene.name for gene in rig.recording_genes]
    for one in dataset.recordings:
        for name in one.estimates:
            if name not in own:
                have = ", ".join(own) or "none"
                raise ValueError(
                    f"recording {one.name!r} has an estimate of {name!r}, but the genes of one recording of rig "
                    f"{rig.name!r} are: {have}; correct the name"
                )
