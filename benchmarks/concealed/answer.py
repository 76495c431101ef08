"""The answer of a trial: what was hidden in its dataset. Plain data, sealed before anything is diagnosed."""

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
    """One effect that was hidden in a dataset.

    Attributes:
        name: of the effect in the library; for an effect that the library does not have, the plant's own name.
        listed: whether the library has the effect.
        side: physics, or a fault of the measurement.
        strength: size of the effect, in the plant's own unit.
        parameters: everything the plant needs to simulate the effect again.
        span, chord: place on the wing, as fractions; None for an effect without a place.
        phase: in beats from the start of the beat as a dataset defines it; None for an effect without a phase.
        values: true values of the library's genes, for those with the same meaning in the plant and in the library.
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
        group: the group it is counted in.
        rig: "wing" or "vehicle".
        division: discretisation of the model to be diagnosed.
        plant: discretisation of the plant.
        secrets: what was hidden; empty in a null trial.
        genome: true values of the nominal genes.
        target: strength d that was aimed at; strength: the d that the scorer's refit measured.
        strength_of_division: misfit / noise after the nominal model is refitted to a plant with nothing hidden; caused
            by
            the coarser discretisation of the model and by the differences between two solvers.
        noise: RMS noise of one channel in the fitted recordings, m or N; noise_held_out: in the held-out ones.
        conditions: of the recordings, by name.
        seed: of the trial; attempt: number of the draw that the plant could simulate; level: factor on the drawn noise.
            With these three the rig can be recorded again.
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
        """Names of the hidden effects."""
        return frozenset(secret.name for secret in self.secrets)

    @property
    def finer(self) -> bool:
        """Whether the plant is discretised more finely than the model to be diagnosed."""
        return self.division != self.plant

    def as_json(self) -> dict[str, Any]:
        """A dictionary that ``json`` can write."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Answer:
        """The inverse of :meth:`as_json`."""
        secrets = tuple(Secret(**secret) for secret in data["secrets"])
        conditions = {name: Condition(**condition) for name, condition in data["conditions"].items()}
        return cls(**{**data, "secrets": secrets, "conditions": conditions})
