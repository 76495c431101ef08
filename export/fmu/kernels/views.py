"""Arrays at addresses, for compiled functions that get one block of memory instead of arrays."""

from __future__ import annotations

from typing import Any

from numba import types
from numba.extending import intrinsic


def _pointer(kind: Any) -> Any:
    @intrinsic
    def function(typingctx: Any, address: Any) -> Any:  # noqa: ARG001
        pointer = types.CPointer(kind)

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ARG001
            return builder.inttoptr(args[0], context.get_value_type(pointer))

        return pointer(types.int64), codegen

    return function


floats = _pointer(types.float64)
integers = _pointer(types.int64)
flags = _pointer(types.boolean)
