"""What may be hidden in a vehicle, or on the way from a motion or a force into a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

Parameters = Mapping[str, float]
Concealed = Mapping[str, Parameters]
"""What is hidden: parameters by name of the law. "strength" is its size; at zero there is nothing."""


@dataclass(frozen=True)
class Law:
    """One thing that may be hidden.

    Attributes:
        name: of the effect in the library that means the same; of what the library lacks, a name of its own.
        side: physics, or a fault of the measurement.
        typical: strength at which it is as large as it is met in practice.
        source: where it is from.
        listed: whether the library has it.
        both_signs: whether the strength may be negative.
        shape: bounds between which each of its other parameters is drawn. Those called "span" and "chord" (parts) and
            "phase" (beats) say where and when it acts.
        values: genes of the library, by name, that mean the same as its parameters.
    """

    name: str
    side: Literal["physics", "measurement"]
    typical: float
    source: str
    listed: bool = True
    both_signs: bool = False
    shape: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    values: Callable[[Parameters], Mapping[str, float]] = lambda _: {}

    def draw(self, rng: np.random.Generator, size: float = 1.0) -> dict[str, float]:
        """Parameters at random, the strength ``size`` times the typical one (of either sign where it may have it)."""
        sign = rng.choice([-1.0, 1.0]) if self.both_signs else 1.0
        drawn = {name: float(rng.uniform(low, high)) for name, (low, high) in self.shape.items()}
        return {"strength": float(sign * size * self.typical), **drawn}


def strength(concealed: Concealed, name: str) -> float:
    """Strength of what is called ``name``; 0 where it is not hidden."""
    return concealed[name]["strength"] if name in concealed else 0.0


def check_known(concealed: Concealed, laws: Mapping[str, Law]) -> None:
    """ValueError for a name that is none of ``laws``, or parameters that are not its own."""
    for name, parameters in concealed.items():
        if name not in laws:
            raise ValueError(f"nothing called {name!r} can be hidden here; there are {', '.join(laws)}")
        wanted = {"strength", *laws[name].shape}
        if set(parameters) != wanted:
            raise ValueError(f"{name!r} has parameters {sorted(parameters)}; it needs {sorted(wanted)}")
