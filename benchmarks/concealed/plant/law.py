"""Description of what can be hidden in a vehicle or in the measurement."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

Parameters = Mapping[str, float]
Concealed = Mapping[str, Parameters]
"""Hidden effects: parameters by name of the law. "strength" is the size; at zero there is no effect."""


@dataclass(frozen=True)
class Law:
    """An effect or a fault that can be hidden.

    Attributes:
        name: of the library's effect with the same meaning, or a name of its own if the library has none.
        side: physics, or a fault of the measurement.
        typical: strength that is typical in practice.
        source: literature.
        listed: whether the library has the effect.
        both_signs: whether the strength may be negative.
        shape: range from which each other parameter is drawn. "span" and "chord" (fractions) and "phase" (beats) say
            where and when the effect acts.
        values: computes the library's genes with the same meaning, by name, from the parameters.
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
        """Random parameters, with the strength ``size`` times the typical one and a random sign if both are allowed."""
        sign = rng.choice([-1.0, 1.0]) if self.both_signs else 1.0
        drawn = {name: float(rng.uniform(low, high)) for name, (low, high) in self.shape.items()}
        return {"strength": float(sign * size * self.typical), **drawn}


def strength(concealed: Concealed, name: str) -> float:
    """Strength of the effect ``name``; 0 if it is not hidden."""
    return concealed[name]["strength"] if name in concealed else 0.0


def check_known(concealed: Concealed, laws: Mapping[str, Law]) -> None:
    """ValueError for a name that is not in ``laws``, or for parameters that do not belong to it."""
    for name, parameters in concealed.items():
        if name not in laws:
            raise ValueError(f"nothing called {name!r} can be hidden here; there are {', '.join(laws)}")
        wanted = {"strength", *laws[name].shape}
        if set(parameters) != wanted:
            raise ValueError(f"{name!r} has parameters {sorted(parameters)}; it needs {sorted(wanted)}")
