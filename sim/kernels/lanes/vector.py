"""Vectors of LANES lanes as values inside kernels, so that arithmetic on several individuals is written as for one.

Inside a compiled kernel ``load(array, i, j)`` gives the lanes of ``array[i, j, :]`` as a vector of the processor
(LLVM's ``<8 x double>`` for eight lanes); ``+ - *`` and ``/`` work on vectors and on a vector with a float; ``store``
writes one back. The automatic vectorisation of the compiler does not achieve this: it unrolls a loop over the lanes
first, and with a variable number of lanes the checks for aliasing take longer than the arithmetic.

Kernels run only compiled; annotations are for the reader and for mypy.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

from wingfit.sim.kernels import LANES

Vector = Any  # to the type checker

_LLVM = ir.VectorType(ir.DoubleType(), LANES)
_FUSED = ("contract",)


class VectorType(types.Type):
    """Numba's type of a vector of LANES floats, one for each individual."""

    def __init__(self) -> None:
        super().__init__(name=f"Vector{LANES}")


vector_type = VectorType()


@register_model(VectorType)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _LLVM)


def _splat(builder: Any, value: Any) -> Any:
    """Return a vector whose lanes all equal the float ``value``."""
    zero = ir.Constant(ir.IntType(32), 0)
    first = builder.insert_element(ir.Constant(_LLVM, ir.Undefined), value, zero)
    mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(first, ir.Constant(_LLVM, ir.Undefined), mask)


def _binary(op: Any, method: str) -> None:
    """Register the operator ``op`` with numba for two vectors, and for a vector and a float in either order.

    ``method``: name of the instruction in llvmlite's ``builder``.
    """

    class Template(ConcreteTemplate):
        cases = [  # noqa: RUF012
            signature(vector_type, vector_type, vector_type),
            signature(vector_type, vector_type, types.float64),
            signature(vector_type, types.float64, vector_type),
        ]

    infer_global(op)(Template)

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ARG001
        a, b = (
            value if kind == vector_type else _splat(builder, value) for value, kind in zip(args, sig.args, strict=True)
        )
        return getattr(builder, method)(a, b, flags=_FUSED)

    for left, right in ((VectorType, VectorType), (VectorType, types.Float), (types.Float, VectorType)):
        lower_builtin(op, left, right)(lower)


for _op, _method in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
    (operator.iadd, "fadd"),
    (operator.isub, "fsub"),
    (operator.imul, "fmul"),
):
    _binary(_op, _method)


@infer_global(operator.neg)
class _NegTemplate(ConcreteTemplate):
    cases = [signature(vector_type, vector_type)]  # noqa: RUF012


@lower_builtin(operator.neg, VectorType)
def _negate(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ARG001
    return builder.fneg(args[0])


def _address(context: Any, builder: Any, kind: Any, array: Any, indices: Any) -> Any:
    """Return a pointer to the lanes ``array[*indices, :]`` of a C-contiguous array of the numba type ``kind``.

    The stride of the last of the ``indices`` is that of one group of lanes, a constant for the compiler.
    """
    proxy = context.make_array(kind)(context, builder, array)
    strides = cgutils.unpack_tuple(builder, proxy.strides)[: len(indices)]
    strides[-1:] = [ir.Constant(ir.IntType(64), 8 * LANES)] * bool(indices)
    offset = ir.Constant(ir.IntType(64), 0)
    for index, stride in zip(indices, strides, strict=True):
        offset = builder.add(offset, builder.mul(index, stride))
    start = builder.bitcast(proxy.data, ir.IntType(8).as_pointer())
    return builder.bitcast(builder.gep(start, [offset]), _LLVM.as_pointer())


def _indices(builder: Any, args: Any, kinds: Any) -> list[Any]:
    return [builder.sext(a, ir.IntType(64)) if kind.bitwidth < 64 else a for a, kind in zip(args, kinds, strict=True)]


def _accessors(count: int) -> tuple[Callable[..., Any], Callable[..., None]]:
    """Return functions that load and store lanes of an array at ``count`` indices; numba needs them for each count."""

    def read(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        indices = _indices(builder, args[1:], sig.args[1:])
        return builder.load(_address(context, builder, sig.args[0], args[0], indices), align=8, typ=_LLVM)

    def write(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        indices = _indices(builder, args[1:-1], sig.args[1:-1])
        value = args[-1] if sig.args[-1] == vector_type else _splat(builder, args[-1])
        builder.store(value, _address(context, builder, sig.args[0], args[0], indices), align=8)
        return context.get_dummy_value()

    names = ("i", "j", "k")[:count]
    arguments = ", ".join(("typingctx", "array", *names))
    typed = ", ".join(("array", *names))
    source = (
        f"def load{count}({arguments}):\n    return vector_type({typed}), read\n"
        f"def store{count}({arguments}, value):\n    return types.void({typed}, value), write\n"
    )
    space: dict[str, Any] = {"vector_type": vector_type, "types": types, "read": read, "write": write}
    exec(source, space)  # noqa: S102  (fixed text, made above)
    return intrinsic(space[f"load{count}"]), intrinsic(space[f"store{count}"])


def _unary(name: str) -> Callable[..., Any]:
    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ARG001
        declared = cgutils.get_or_insert_function(builder.module, ir.FunctionType(_LLVM, [_LLVM]), name)
        return builder.call(declared, args)

    @intrinsic
    def function(typingctx: Any, x: Any) -> Any:  # noqa: ARG001
        return vector_type(x), codegen

    return function


def _binary_intrinsic(name: str) -> Callable[..., Any]:
    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ARG001
        declared = cgutils.get_or_insert_function(builder.module, ir.FunctionType(_LLVM, [_LLVM, _LLVM]), name)
        return builder.call(declared, [args[0], _splat(builder, args[1])])

    @intrinsic
    def function(typingctx: Any, x: Any, limit: Any) -> Any:  # noqa: ARG001
        return vector_type(x, types.float64), codegen

    return function


# lanes of array[:], array[i, :], array[i, j, :] and array[i, j, k, :]
load0, store0 = _accessors(0)
load1, store1 = _accessors(1)
load, store = _accessors(2)
load3, store3 = _accessors(3)
root = _unary(f"llvm.sqrt.v{LANES}f64")
magnitude = _unary(f"llvm.fabs.v{LANES}f64")
least = _binary_intrinsic(f"llvm.minnum.v{LANES}f64")  # of a vector and a float
greatest = _binary_intrinsic(f"llvm.maxnum.v{LANES}f64")
