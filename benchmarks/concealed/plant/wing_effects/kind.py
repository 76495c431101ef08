"""A kind of effect that can be hidden in a wing: its law, size, shape and source."""

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
    """A kind of effect.

    Attributes:
        name: as in the library if ``listed``, else the plant's own.
        family: structure, inertia, actuation or aerodynamics.
        listed: whether the library has it.
        unit: of its strength; ``typical``: a strength that is easily detected with a noise of 0.5 mm.
        largest: strength above which it is not physical, or above which a periodic motion may not exist.
        shape: other parameters by name, as (typical value, lower bound, upper bound).
        source: literature, and how the law differs from the library's.
        put: applies it to a draft, after the wing was divided unless ``before`` is set.
        genes: true values of the library's genes with the same meaning.
        acting: magnitude [n] at heights [n] (m) and vertical speeds [n] (m/s) of its place; only for effects whose
            phase depends on the motion.
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
