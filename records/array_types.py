"""Types of arrays. ``Float[Array, "T C"]`` names the shape, which tests check (docs/decisions/0017-array-shapes.md)."""

import numpy as np
import numpy.typing as npt
from jaxtyping import Bool, Float, Int

__all__ = ["Array", "ArrayLike", "Bool", "Complex", "Float", "Index", "Int", "Mask"]

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]
ArrayLike = npt.ArrayLike
