"""Description of one kind of effect that can be hidden in a wing: how it is applied, its parameters and its source."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.plant.wing.build import Draft
from wingfit.records import Wing

Array = npt.NDArray[np.float64]
Family = Literal["structure", "inertia", "actuation", "aerodynamics"]
Values = Mapping[str, float]


@dataclass(frozen=True)
class Kind:
    """A kind of effect. "The library" is the set of effects that the diagnosis can name.

    Attributes:
        name: as in the library if ``listed``, else a name used only here.
        family: structure, inertia, actuation or aerodynamics.
        listed: whether the library has the effect.
        unit: unit of the strength; ``typical``: a strength that is easily detected with a noise of 0.5 mm.
        largest: strength above which it is not physical, or above which a periodic motion may not exist.
        shape: other parameters by name, as (typical value, lower bound, upper bound).
        source: literature, and how the law differs from the library's.
        put: function that applies the effect, with its strength and other parameters, to a draft.
        genes: function that returns the true values of those genes of the library's effect with the same meaning.
        before: whether ``put`` is called before the wing is divided into bodies, not after.
        acting: function that returns the magnitude [n] of the effect from the heights [n] (m) and vertical speeds [n]
            (m/s) of its position; only for effects whose phase in the beat depends on the motion.
    """

    name: str
    family: Family
    listed: bool
    unit: str
    typical: float
    largest: float
    source: str
    put: Callable[[Draft, float, Values], None]
    shape: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    genes: Callable[[Wing, float, Values], dict[str, float]] | None = None
    before: bool = False
    acting: Callable[[Draft, Values, Array, Array], Array] | None = None
