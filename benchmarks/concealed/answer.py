"""The answer of a trial: what was hidden in its dataset. Plain data; its hash is published before any diagnosis.

"The plant" is the simulator that produces the datasets, "the library" the set of effects that a diagnosis can name.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, get_args

from wingfit.records import Condition

Group = Literal["null", "listed", "unlisted", "smooth", "measurement", "pairs", "partly", "every", "drift", "advice"]
GROUPS: tuple[Group, ...] = get_args(Group)
Side = Literal["physics", "measurement"]


@dataclass(frozen=True)
class Secret:
    """One effect that was hidden in a dataset.

    Attributes:
        name: of the effect in the library of the diagnosis; for one that the library does not have, the plant's own.
        listed: whether the library has the effect.
        side: "physics", or "measurement" for a fault of the measurement.
        strength: size of the effect, in the unit that the plant uses for it.
        parameters: everything the plant needs to simulate the effect again.
        span, chord: place on the wing, as fractions; None for an effect without a place.
        phase: in beats from the start of the beat as a dataset defines it; None for an effect without a phase.
        values: true values, by name, of the genes of the library's effect that have the same meaning in
            the plant.
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
        group: the group of trials it is counted in, from GROUPS.
        rig: "wing" or "vehicle".
        division: discretisation (bodies of the wing) of the model to be diagnosed; "" for a vehicle.
        plant: discretisation of the plant (the simulator that produced the dataset); "" for a vehicle.
        secrets: what was hidden; empty in a null trial.
        genome: true values of the nominal model's genes (parameters), by name.
        target: strength d aimed at: RMS misfit of the refitted nominal model, divided by the RMS noise.
        strength: strength d that the refit of :mod:`.strength` measured.
        strength_of_division: misfit / noise of the nominal model to a plant with nothing hidden, after a refit if the
            plant is discretised more finely; caused by discretisation and by the differences between two solvers.
        noise: RMS noise of one channel in the fitted recordings, m or N.
        noise_held_out: the same in the held-out recordings.
        conditions: condition of each recording, by the recording's name.
        seed: random seed of the trial.
        attempt: number of the random draw that was recorded, from 0: the first that the plant could simulate.
        level: factor on the drawn noise. With seed, attempt and level the rig can be recorded again.
        body: which wing or vehicle it is, a key of :data:`.rigs.GRIDS`.
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
    body: str = "robird"

    @property
    def names(self) -> frozenset[str]:
        """Names of the hidden effects."""
        return frozenset(secret.name for secret in self.secrets)

    @property
    def finer(self) -> bool:
        """Whether the plant is discretised more finely than the model to be diagnosed."""
        return self.division != self.plant

    def as_json(self) -> dict[str, Any]:
        """The answer as a dictionary that ``json`` can write."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Answer:
        """The answer that :meth:`as_json` converted to the dictionary ``data``."""
        secrets = tuple(Secret(**secret) for secret in data["secrets"])
        conditions = {name: Condition(**condition) for name, condition in data["conditions"].items()}
        return cls(**{**data, "secrets": secrets, "conditions": conditions})
