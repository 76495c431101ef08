"""Series on the wire: as many digits as mean something."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

DIGITS = 7  # beyond, there is only noise; and a wing of many bodies has megabytes of numbers
MOST_PLACES = 300  # 10 to the power of more is no number


def rounded(series: npt.NDArray[np.float64]) -> list[Any]:
    """``series`` as plain numbers, rounded to DIGITS below the largest of them."""
    largest = float(np.abs(series).max())
    places = DIGITS - math.ceil(math.log10(largest)) if largest > 0 else 0
    return list((np.round(series, min(places, MOST_PLACES)) + 0.0).tolist())
