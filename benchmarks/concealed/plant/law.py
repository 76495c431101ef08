"""Description of the effects that can be hidden in simulated test data: physics of a vehicle, or measurement faults."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

Parameters = Mapping[str, float]
Concealed = Mapping[str, Parameters]
"""Hidden effects by name of their :class:`Law`, each with its parameters by name.

"strength" is the size of the effect; at zero there is no effect.
"""


@dataclass(frozen=True)
class Law:
    """An effect that can be hidden in test data. "The library" is the set of effects that a diagnosis can detect.

    Attributes:
        name: of the library's effect with the same meaning, or a name of its own if the library has none.
        side: "physics", or "measurement" for a fault of the measurement.
        typical: strength that is typical in practice, in the unit of the effect.
        source: literature on which the equation is based.
        listed: whether the library has the effect.
        both_signs: whether the strength may be negative.
        shape: (low, high) of the uniform distribution of each parameter other than the strength. "span" and "chord"
            (fractions) and "phase" (beats) say where and when the effect acts.
        values: function from the parameters to the true values, by name, of those genes of the library's effect
            that have the same meaning as one of the parameters.
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
    """Raise ValueError if a name is not in ``laws``, or if its parameters are not exactly those of its law."""
    for name, parameters in concealed.items():
        if name not in laws:
            raise ValueError(f"nothing called {name!r} can be hidden here; there are {', '.join(laws)}")
        wanted = {"strength", *laws[name].shape}
        if set(parameters) != wanted:
            raise ValueError(f"{name!r} has parameters {sorted(parameters)}; it needs {sorted(wanted)}")
