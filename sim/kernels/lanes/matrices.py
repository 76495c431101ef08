"""Algebra of 3-vectors and 3 x 3 matrices inside kernels, for eight individuals at a time.

An element is a vector of eight lanes, one for each individual (``Vector``). A 3-vector is a tuple of three elements, a
matrix a tuple of nine, row by row; both stay in registers. e~ is the matrix of the cross product, e~ x = e x x.
"""

from __future__ import annotations

from wingfit.records.array_types import Array
from wingfit.sim.kernels.jit import inlined
from wingfit.sim.kernels.lanes.vector import Vector, load, store

Three = tuple[Vector, Vector, Vector]
Nine = tuple[Vector, Vector, Vector, Vector, Vector, Vector, Vector, Vector, Vector]
Six = tuple[Nine, Nine, Nine, Nine]  # 6 x 6: moment-rotation, moment-translation, force-rotation, force-translation


@inlined
def load_vector(array: Array, n: int, k: int) -> Three:
    """Load elements k, k + 1, k + 2 of row ``n`` of ``array`` [., ., W]."""
    return load(array, n, k), load(array, n, k + 1), load(array, n, k + 2)


@inlined
def load_matrix(array: Array, n: int) -> Nine:
    """Load the nine elements of row ``n`` of ``array`` [., 9, W]."""
    return load_vector(array, n, 0) + load_vector(array, n, 3) + load_vector(array, n, 6)


@inlined
def store_vector(array: Array, n: int, k: int, x: Three) -> None:
    """Store ``x`` as the elements k, k + 1, k + 2 of row ``n`` of ``array`` [., ., W]."""
    store(array, n, k, x[0])
    store(array, n, k + 1, x[1])
    store(array, n, k + 2, x[2])


@inlined
def store_matrix(array: Array, n: int, A: Nine) -> None:
    """Store A as row ``n`` of ``array`` [., 9, W]."""
    store_vector(array, n, 0, A[:3])
    store_vector(array, n, 3, A[3:6])
    store_vector(array, n, 6, A[6:])


@inlined
def add_wrench(wrench: Array, n: int, t: Three, f: Three) -> None:
    """Add the moment t and the force f to row n of ``wrench`` [., 6, W]."""
    store_vector(wrench, n, 0, added(load_vector(wrench, n, 0), t))
    store_vector(wrench, n, 3, added(load_vector(wrench, n, 3), f))


@inlined
def added(a: Three, b: Three) -> Three:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def less(a: Three, b: Three) -> Three:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def negative(a: Three) -> Three:
    """Return -a."""
    return -a[0], -a[1], -a[2]


@inlined
def extended(a: Three, factor: float, b: Three) -> Three:
    """Return a + ``factor`` b."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


@inlined
def load_inertia(inertia: Array, n: int) -> Nine:
    """Load the inertia of body ``n`` from ``inertia`` [N, 9], the same for all individuals."""
    return (
        inertia[n, 0], inertia[n, 1], inertia[n, 2],
        inertia[n, 3], inertia[n, 4], inertia[n, 5],
        inertia[n, 6], inertia[n, 7], inertia[n, 8],
    )  # fmt: skip


@inlined
def gyroscopic(inertia: Nine, omega: Three) -> Nine:
    """Return the derivative omega~ I - (I omega)~ of omega x (I omega) by omega; x~: matrix of the cross product."""
    return plus(skew_times(omega, inertia), scaled(-1.0, skew(times(inertia, omega))))


@inlined
def plus(A: Nine, B: Nine) -> Nine:
    """Return A + B."""
    return (
        A[0] + B[0], A[1] + B[1], A[2] + B[2],
        A[3] + B[3], A[4] + B[4], A[5] + B[5],
        A[6] + B[6], A[7] + B[7], A[8] + B[8],
    )  # fmt: skip


@inlined
def scaled(factor: float, A: Nine) -> Nine:
    """Return ``factor`` A."""
    return (
        factor * A[0], factor * A[1], factor * A[2],
        factor * A[3], factor * A[4], factor * A[5],
        factor * A[6], factor * A[7], factor * A[8],
    )  # fmt: skip


@inlined
def transposed(A: Nine) -> Nine:
    """Return A^T."""
    return A[0], A[3], A[6], A[1], A[4], A[7], A[2], A[5], A[8]


@inlined
def product(A: Nine, B: Nine) -> Nine:
    """Return A B."""
    return (
        A[0] * B[0] + A[1] * B[3] + A[2] * B[6], A[0] * B[1] + A[1] * B[4] + A[2] * B[7],
        A[0] * B[2] + A[1] * B[5] + A[2] * B[8],
        A[3] * B[0] + A[4] * B[3] + A[5] * B[6], A[3] * B[1] + A[4] * B[4] + A[5] * B[7],
        A[3] * B[2] + A[4] * B[5] + A[5] * B[8],
        A[6] * B[0] + A[7] * B[3] + A[8] * B[6], A[6] * B[1] + A[7] * B[4] + A[8] * B[7],
        A[6] * B[2] + A[7] * B[5] + A[8] * B[8],
    )  # fmt: skip


@inlined
def times(A: Nine, x: Three) -> Three:
    """Return A x."""
    return (
        A[0] * x[0] + A[1] * x[1] + A[2] * x[2],
        A[3] * x[0] + A[4] * x[1] + A[5] * x[2],
        A[6] * x[0] + A[7] * x[1] + A[8] * x[2],
    )


@inlined
def columns_scaled(A: Nine, s: Three) -> Nine:
    """Return A diag(s)."""
    return (
        A[0] * s[0], A[1] * s[1], A[2] * s[2],
        A[3] * s[0], A[4] * s[1], A[5] * s[2],
        A[6] * s[0], A[7] * s[1], A[8] * s[2],
    )  # fmt: skip


@inlined
def rows_scaled(s: Three, A: Nine) -> Nine:
    """Return diag(s) A."""
    return (
        s[0] * A[0], s[0] * A[1], s[0] * A[2],
        s[1] * A[3], s[1] * A[4], s[1] * A[5],
        s[2] * A[6], s[2] * A[7], s[2] * A[8],
    )  # fmt: skip


@inlined
def cross(a: Three, b: Three) -> Three:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def times_six(M: Six, x: Three, y: Three) -> tuple[Three, Three]:
    """Return M (x, y), where ``x`` and ``y`` are the halves of a 6-vector, and M is four 3 x 3 quarters."""
    return added(times(M[0], x), times(M[1], y)), added(times(M[2], x), times(M[3], y))


@inlined
def skew(e: Three) -> Nine:
    """Return e~, the matrix of the cross product with ``e``."""
    zero = e[0] - e[0]
    return zero, -e[2], e[1], e[2], zero, -e[0], -e[1], e[0], zero


@inlined
def skew_times(e: Three, A: Nine) -> Nine:
    """Return e~ A, where e~ is the matrix of the cross product with ``e``."""
    return (
        e[1] * A[6] - e[2] * A[3], e[1] * A[7] - e[2] * A[4], e[1] * A[8] - e[2] * A[5],
        e[2] * A[0] - e[0] * A[6], e[2] * A[1] - e[0] * A[7], e[2] * A[2] - e[0] * A[8],
        e[0] * A[3] - e[1] * A[0], e[0] * A[4] - e[1] * A[1], e[0] * A[5] - e[1] * A[2],
    )  # fmt: skip


@inlined
def times_skew(A: Nine, e: Three) -> Nine:
    """Return A e~, where e~ is the matrix of the cross product with ``e``."""
    return (
        A[1] * e[2] - A[2] * e[1], A[2] * e[0] - A[0] * e[2], A[0] * e[1] - A[1] * e[0],
        A[4] * e[2] - A[5] * e[1], A[5] * e[0] - A[3] * e[2], A[3] * e[1] - A[4] * e[0],
        A[7] * e[2] - A[8] * e[1], A[8] * e[0] - A[6] * e[2], A[6] * e[1] - A[7] * e[0],
    )  # fmt: skip


@inlined
def trace_minus(A: Nine) -> Nine:
    """Return tr(A) I - A."""
    return (
        A[4] + A[8], -A[1], -A[2],
        -A[3], A[0] + A[8], -A[5],
        -A[6], -A[7], A[0] + A[4],
    )  # fmt: skip


@inlined
def axial(A: Nine) -> Three:
    """Return the vector a whose cross-product matrix a~ is A - A^T."""
    return A[7] - A[5], A[2] - A[6], A[3] - A[1]


@inlined
def outer(a: Three, b: Three) -> Nine:
    """Return a b^T."""
    return (
        a[0] * b[0], a[0] * b[1], a[0] * b[2],
        a[1] * b[0], a[1] * b[1], a[1] * b[2],
        a[2] * b[0], a[2] * b[1], a[2] * b[2],
    )  # fmt: skip


@inlined
def with_diagonal(A: Nine, s: Three) -> Nine:
    """Return A + diag(s)."""
    return A[0] + s[0], A[1], A[2], A[3], A[4] + s[1], A[5], A[6], A[7], A[8] + s[2]


@inlined
def co_stiffness(k: Three) -> Three:
    """Return the diagonal of G = tr(K) / 2 - K for a diagonal stiffness K = diag(k) (thesis Eq. 5)."""
    return 0.5 * (k[1] + k[2] - k[0]), 0.5 * (k[2] + k[0] - k[1]), 0.5 * (k[0] + k[1] - k[2])


@inlined
def co_stiffness_matrix(K: Nine) -> Nine:
    """Return G = tr(K) / 2 - K for a full stiffness matrix K."""
    half = 0.5 * (K[0] + K[4] + K[8])
    return half - K[0], -K[1], -K[2], -K[3], half - K[4], -K[5], -K[6], -K[7], half - K[8]


@inlined
def _quarter(blocks: Array, m: int, at: int) -> Nine:
    """Load the 3 x 3 quarter of block ``m`` of ``blocks`` [NB, 36, W] that starts at element ``at``."""
    return load_vector(blocks, m, at) + load_vector(blocks, m, at + 6) + load_vector(blocks, m, at + 12)


@inlined
def load_block(blocks: Array, m: int) -> Six:
    """Load the 6 x 6 matrix of block ``m`` of ``blocks`` [NB, 36, W]."""
    return _quarter(blocks, m, 0), _quarter(blocks, m, 3), _quarter(blocks, m, 18), _quarter(blocks, m, 21)


@inlined
def add_to_block(blocks: Array, m: int, A: Six) -> None:
    """Add A, a 6 x 6 matrix as four 3 x 3 quarters, to block m of ``blocks`` [NB, 36, W]."""
    _set_quarter(blocks, m, 0, plus(_quarter(blocks, m, 0), A[0]))
    _set_quarter(blocks, m, 3, plus(_quarter(blocks, m, 3), A[1]))
    _set_quarter(blocks, m, 18, plus(_quarter(blocks, m, 18), A[2]))
    _set_quarter(blocks, m, 21, plus(_quarter(blocks, m, 21), A[3]))


@inlined
def _set_quarter(blocks: Array, m: int, at: int, A: Nine) -> None:
    """Store A as the 3 x 3 quarter of block ``m`` of ``blocks`` [NB, 36, W] that starts at element ``at``."""
    store_vector(blocks, m, at, A[:3])
    store_vector(blocks, m, at + 6, A[3:6])
    store_vector(blocks, m, at + 12, A[6:])


@inlined
def set_block(blocks: Array, m: int, A: Six) -> None:
    """Put A, a 6 x 6 matrix as four 3 x 3 quarters, into block m of ``blocks`` [NB, 36, W]."""
    _set_quarter(blocks, m, 0, A[0])
    _set_quarter(blocks, m, 3, A[1])
    _set_quarter(blocks, m, 18, A[2])
    _set_quarter(blocks, m, 21, A[3])
