"""What was hidden in a dataset: plain data, written under seal before anything is diagnosed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from wingfit.records import Condition

Group = Literal["null", "listed", "unlisted", "measurement", "pairs", "advice"]
GROUPS: tuple[Group, ...] = ("null", "listed", "unlisted", "measurement", "pairs", "advice")
Side = Literal["physics", "measurement"]


@dataclass(frozen=True)
class Secret:
    """One thing that was hidden.

    Attributes:
        name: of the effect in the library; of what the library lacks, the plant's own name.
        listed: whether the library has it.
        side: physics, or a fault of the measurement.
        strength: the plant's own measure of its size.
        parameters: all that the plant needs to show it again.
        span, chord: place on the wing in parts; None where it has none.
        phase: in beats, from the start of the beat as a dataset defines it; None where it has none.
        values: true values of the library's genes, for those that mean the same in plant and library.
    """

    name: str
    listed: bool
    side: Side
    strength: float
    parameters: Mapping[str, float] = field(default_factory=dict)
    span: float | None = None
    chord: float | None = None
    phase: float | None = None
    values: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Answer:
    """The answer of one trial.

    Attributes:
        trial: its name.
        group: what it is counted among.
        rig: "wing" or "vehicle".
        division: of the model that the tool is given; plant: that of the plant.
        secrets: what was hidden; empty in a null trial.
        genome: true values of the nominal genes.
        target: the strength d that was aimed at; strength: the one that the scorer's refit found.
        strength_of_division: misfit over noise that a refit leaves of the plant with nothing hidden: by the model's
            coarser division, and by what two simulations differ.
        noise: root mean square of the noise of one channel in the fitted recordings; noise_held_out: in the others.
        conditions: that were recorded, by name of the recording.
        seed: of the trial; attempt: which draw of it the plant could run; level: of the recordings' noise, by which
            that of the quality drawn is multiplied. With these the rig can be recorded again.
    """

    trial: str
    group: Group
    rig: Literal["wing", "vehicle"]
    division: str
    plant: str
    secrets: tuple[Secret, ...]
    genome: Mapping[str, float]
    target: float
    strength: float
    strength_of_division: float
    noise: float
    noise_held_out: float
    conditions: Mapping[str, Condition]
    seed: int
    attempt: int = 0
    level: float = 1.0

    @property
    def names(self) -> frozenset[str]:
        """Names of what was hidden."""
        return frozenset(secret.name for secret in self.secrets)

    @property
    def finer(self) -> bool:
        """Whether the plant is divided finer than the tool's model."""
        return self.division != self.plant

    def as_json(self) -> dict[str, Any]:
        """As JSON takes it."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Answer:
        """The inverse of :meth:`as_json`."""
        secrets = tuple(Secret(**secret) for secret in data["secrets"])
        conditions = {name: Condition(**condition) for name, condition in data["conditions"].items()}
        return cls(**{**data, "secrets": secrets, "conditions": conditions})
