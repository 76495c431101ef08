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
        name: as in the tool's library if ``listed``, else the plant's own.
        family: what sort of thing it is.
        listed: whether the library has it.
        unit: of its strength; ``typical``: a strength that is easily seen beside noise of half a millimetre.
        largest: strength beyond which it makes no sense, or no periodic motion is sure to be found.
        shape: other parameters by name, with typical value and range: (value, lower, upper).
        source: where the law is from, and in which form.
        put: changes a draft for a strength and the parameters; called once the wing is cut unless ``before`` is set.
        genes: true values of the library's genes, of those that mean the same.
        acting: how large it is [n] while its place is at heights [n] (m) and rises at rates [n] (m/s); only of effects
            of which nothing but the motion tells when they act.
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
