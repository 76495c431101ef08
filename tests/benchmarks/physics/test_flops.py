from __future__ import annotations

import numpy as np
import pytest

from benchmarks.physics import flops
from benchmarks.physics.flops import Counter, count_step, counting, peak_gflops
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.bodies import times_mass
from wingfit.sim.kernels.jit import inlined, kernel
from wingfit.sim.kernels.lanes import vector
from wingfit.sim.kernels.lanes.vector import Vector, load, load1, magnitude, root, store, store1

Array = np.typing.NDArray[np.float64]


@inlined
def _squared(x: Vector) -> Vector:
    return x * x


@kernel
def _norms(x: Array, scale: float, out: Array) -> None:
    """Twelve operations a row: the squares, their sum and root, and one of each kind with a vector and with a number.

    Signs, magnitudes and the product with 1 are free.
    """
    for n in range(len(x)):
        a, b = load(x, n, 0), load(x, n, 1)
        length = root(_squared(a) + _squared(b))
        moved = 2.0 - (length * scale + 0.25) / 3.0
        store1(out, n, -magnitude(1.0 * moved) - (1.0 / length) * a / length)


def test_operations_of_a_known_kernel() -> None:
    x, counter = np.random.default_rng(0).normal(size=(5, 2, LANES)), Counter()
    compiled, plain = np.zeros((5, LANES)), np.zeros((5, LANES))
    _norms(x, 0.7, compiled)
    counting(_norms, counter)(x, 0.7, plain)
    assert counter.operations == 5 * 12 * LANES
    np.testing.assert_allclose(plain, compiled, rtol=1e-13)
    length = np.hypot(x[:, 0], x[:, 1])
    np.testing.assert_allclose(plain, -np.abs(2 - (length * 0.7 + 0.25) / 3) - x[:, 0] / length**2, rtol=1e-13)


def test_operations_of_momentum() -> None:
    """M V of a body: three rows of three products and as many sums, three products and sums for the velocity."""
    counter, rng = Counter(), np.random.default_rng(1)
    arrays = rng.normal(size=4), rng.normal(size=(4, 9)), rng.normal(size=(4, 6, LANES)), np.zeros((4, 6, LANES))
    counting(times_mass, counter)(*arrays)
    assert counter.operations == 4 * 24 * LANES


@pytest.mark.parametrize("division", ["4", "11"])
def test_counted_step_computes_what_the_compiled_one_does(division: str) -> None:
    """They differ by the rounding of fused operations, which stiff springs magnify."""
    assert 0 < count_step(division).difference < 1e-11


def test_count_grows_with_the_bodies_and_lies_above_the_elimination_alone() -> None:
    """Four blocks of 6 x 6 to invert, three below to multiply, three products to subtract, six solves: a chain."""
    least = (4 * 2 * 6**3 + 3 * 2 * 6**3 + 3 * 2 * 6**3) + 6 * 10 * 2 * 36
    four, eleven = (count_step(division).operations / LANES for division in ("4", "11"))
    assert least < four < eleven / (11 / 4)


def test_peak_counts_the_operations_of_its_loop() -> None:
    for sums, loop in zip(flops.SUMS, (flops._few, flops._many), strict=True):
        counter, data = Counter(), np.ones((sums + 2, LANES))
        data[sums] = 0.5
        counting(loop, counter)(data, 3)
        assert counter.operations == 3 * 2 * sums * LANES
        np.testing.assert_allclose(data[:sums], 1.875)


def test_peak_is_that_of_a_core() -> None:
    assert 2.0 < peak_gflops(repeats=2, rounds=50_000) < 500.0


def test_lane_function_that_cannot_be_counted_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vector, "magnitude", None)
    with pytest.raises(NotImplementedError, match="counting version"):
        counting(_norms, Counter())


def test_store_keeps_a_float_in_all_lanes() -> None:
    @kernel
    def fill(out: Array) -> None:
        store(out, 0, 1, 3.0)
        store1(out[0], 0, load1(out[0], 1))

    out = np.zeros((1, 2, LANES))
    counting(fill, Counter())(out)
    assert np.array_equal(out, np.full((1, 2, LANES), 3.0))
