"""Rounds series of numbers in JSON answers to significant digits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

DIGITS = 7  # later digits are noise, and a wing of many bodies has megabytes of numbers
MOST_PLACES = 300  # a larger power of 10 is not a float


def rounded(series: npt.NDArray[np.float64]) -> list[Any]:
    """Return ``series`` as nested lists, rounded so that its largest number has DIGITS significant digits."""
    largest = float(np.abs(series).max())
    places = DIGITS - math.ceil(math.log10(largest)) if largest > 0 else 0
    return list((np.round(series, min(places, MOST_PLACES)) + 0.0).tolist())
