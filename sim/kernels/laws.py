"""Compiled laws of effects, called by address: the integrator is compiled once, whichever effects are on.

A law is a function ``law(frame, moment)`` that adds the loads of one effect. It is compiled separately, when it is
first used (:func:`address`), and cached by the source of its file and of the kernels. ``frame`` points to a row of
integers: sizes and the addresses of arrays, which ``strip_port(frame)``, ``connector_port(frame)`` or
``point_port(frame)`` returns by name. The last axis of these arrays is the W individuals, to be used with the functions
of :mod:`wingfit.sim.kernels.lanes.vector`. Laws of the air are called at two moments of every stage: BEFORE the flow of
the strips is known, when they may set the induced velocity from their states, and AFTER, when they change the loads and
set the rates of their states. Laws of connectors and of points are called once, AFTER.
"""

from __future__ import annotations

import threading
from collections import namedtuple
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import carray, types
from numba.extending import intrinsic

from wingfit.records.array_types import Array
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import CLOCK, FLOW, GEOMETRY, LOADS
from wingfit.sim.kernels.jit import callback, inlined

Law = Callable[[Any, int], None]

BEFORE, AFTER = 0, 1
SIGNATURE = types.void(types.CPointer(types.int64), types.int64)


StripPort = namedtuple("StripPort", "places parameters state rate decay flow loads induced geometry density wind clock")
"""Inputs and outputs of a law of the air for W individuals. ``places`` is the number S of strips.

``parameters`` [P, S, W] and ``state`` [K, S, W] are those of this law. It reads ``flow`` [S, FLOW, W], ``geometry``
[S, GEOMETRY] (columns: :mod:`wingfit.sim.kernels.arrays`), ``density`` [W] (kg/m^3), ``wind`` [3, W] (m/s) and
``clock`` [CLOCK, W], drive phases in rad: a load f that depends on the phase itself is f(NOW) + SHARE f'(START). It
adds to or changes ``loads`` [S, LOADS, W] and, only BEFORE, ``induced`` [S, 3, W], a velocity of the air in the world
(m/s). AFTER, it sets ``rate`` [K, S, W], the time derivatives of its states, and ``decay`` [K, S, W], minus the
derivative of each rate by the state itself (1/s).
"""


ConnectorPort = namedtuple(
    "ConnectorPort",
    "places parameters state rate decay drive pull Q d twist wrench stiffness damping lost stored",
)
"""Inputs and outputs of a law of connectors for W individuals. ``places`` is the number C of connectors.

``parameters`` [P, C, W] and ``state`` [K, C, W] are those of this law. It reads ``Q`` [C, 9, W] and ``d`` [C, 3, W]
(m), the pose of the second body's frame in the first's; ``twist`` [C, 6, W] of the second relative to the first
(rad/s, m/s), about the axes of the first. It adds to ``wrench`` [C, 6, W] (moment, force) on the second body in the
axes of the first; to ``stiffness`` and ``damping`` [C, 6, W], minus the derivatives of that wrench by displacement and
twist; to ``lost`` and ``stored`` [W], power lost (W) and energy stored (J). It sets for each state [K, C, W] its
``rate``, its ``decay``, minus the derivative of the rate by the state, its ``drive``, the derivative of the rate by the
twist along the state's axis, and its ``pull``, minus the derivative of the wrench along that axis by the state.
"""


PointPort = namedtuple("PointPort", "places parameters place turn twist wrench stiffness damping lost stored clock")
"""Inputs and outputs of a law of points of bodies for W individuals, in world axes. ``places``: number P of points.

``parameters`` [N, P, W] are those of this law. A place on the wing can lie on different bodies in different
individuals; each of these bodies has a point, and where all parameters are zero the wrench must be zero. The law reads
``place`` [P, 3, W], the position of the point (m), ``turn`` [P, 9, W], the rotation of its body, ``twist`` [P, 6, W],
the body's angular velocity and the velocity of the point (rad/s, m/s), and ``clock`` as for a strip. It adds to
``wrench`` [P, 6, W], moment about the point and force on it (N m, N); to ``stiffness`` and ``damping`` [P, 36, W],
minus the derivatives of the wrench by the motion (rotation, displacement) and by the twist, 6 x 6 row by row; to
``lost`` and ``stored`` [W], power that the wing loses (W; power given to it is negative) and energy stored (J).
"""


@intrinsic
def _doubles(typingctx: Any, address: Any) -> Any:  # noqa: ARG001
    """Convert the integer ``address`` to a pointer to floats."""
    kind = types.CPointer(types.float64)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ARG001
        return builder.inttoptr(args[0], context.get_value_type(kind))

    return kind(types.int64), codegen


@intrinsic
def call(typingctx: Any, function: Any, frame: Any, moment: Any) -> Any:  # noqa: ARG001
    """Call the law at address ``function`` with the frame at address ``frame``, at ``moment`` BEFORE or AFTER."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:  # noqa: ARG001
        long = ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [long.as_pointer(), long])
        pointer = builder.inttoptr(args[0], kind.as_pointer())
        builder.call(pointer, [builder.inttoptr(args[1], long.as_pointer()), args[2]])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), codegen


@inlined
def _table(address: Any, rows: int, columns: int) -> Array:
    """Return the array [rows, columns, W] of floats at ``address``, without a copy."""
    return carray(_doubles(address), (rows, columns, LANES))


@inlined
def _rows(address: Any, count: int) -> Array:
    """Return the array [count, W] of floats at ``address``, without a copy."""
    return carray(_doubles(address), (count, LANES))


@inlined
def _lanes(address: Any) -> Array:
    """Return the array [W] of floats at ``address``, without a copy."""
    return carray(_doubles(address), (LANES,))


@inlined
def strip_port(frame: Any) -> StripPort:
    """Return the arrays of a law of the air, by name, from its ``frame``: sizes, then addresses."""
    S, P, K = frame[0], frame[1], frame[2]
    return StripPort(
        S, _table(frame[3], P, S), _table(frame[4], K, S), _table(frame[5], K, S), _table(frame[6], K, S),
        _table(frame[7], S, FLOW), _table(frame[8], S, LOADS), _table(frame[9], S, 3),
        carray(_doubles(frame[10]), (S, GEOMETRY)), _lanes(frame[11]), _rows(frame[12], 3), _rows(frame[13], CLOCK),
    )  # fmt: skip


@inlined
def connector_port(frame: Any) -> ConnectorPort:
    """Return the arrays of a law of the connectors, by name, from its ``frame``: sizes, then addresses."""
    C, P, K = frame[0], frame[1], frame[2]
    return ConnectorPort(
        C, _table(frame[3], P, C), _table(frame[4], K, C), _table(frame[5], K, C), _table(frame[6], K, C),
        _table(frame[7], K, C), _table(frame[8], K, C), _table(frame[9], C, 9), _table(frame[10], C, 3),
        _table(frame[11], C, 6), _table(frame[12], C, 6), _table(frame[13], C, 6), _table(frame[14], C, 6),
        _lanes(frame[15]), _lanes(frame[16]),
    )  # fmt: skip


@inlined
def point_port(frame: Any) -> PointPort:
    """Return the arrays of a law of points of bodies, by name, from its ``frame``: sizes, then addresses."""
    K, P = frame[0], frame[1]
    return PointPort(
        K, _table(frame[3], P, K), _table(frame[4], K, 3), _table(frame[5], K, 9), _table(frame[6], K, 6),
        _table(frame[7], K, 6), _table(frame[8], K, 36), _table(frame[9], K, 36), _lanes(frame[10]),
        _lanes(frame[11]), _rows(frame[12], CLOCK),
    )  # fmt: skip


_COMPILED: dict[Law, Any] = {}  # never removed, because their addresses are in use
_LOCK = threading.Lock()


def address(law: Law) -> int:
    """Return the address of ``law`` in this process; it is compiled, or read from the cache, on the first call."""
    with _LOCK:
        if law not in _COMPILED:
            _COMPILED[law] = callback(law, SIGNATURE)
        return int(_COMPILED[law].address)
