"""In place of :mod:`wingfit.records.array_types` in exported code: shapes are for the reader and are not checked."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


class _Shaped:
    """Takes the shape of an array in brackets and ignores it."""

    def __class_getitem__(cls, shape: object) -> Any:
        return Any


Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]
ArrayLike = npt.ArrayLike
Float = Bool = Int = _Shaped
