"""The kinds of mistakes: what each does to a good dataset, and which finding of the checks names it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wingfit.records import Dataset


@dataclass(frozen=True)
class Kind:
    """One kind of mistake.

    Attributes:
        name: of the mistake.
        rig: "wing" or "vehicle".
        make: returns the dataset with the mistake, None where it changes nothing or does not apply.
        causes: kinds of findings that name it; or a word that the refusal of the format has.
        fixable: whether a corrected copy is expected.
    """

    name: str
    rig: str
    make: Callable[[Dataset, np.random.Generator], Dataset | None]
    causes: tuple[str, ...]
    fixable: bool = True
