"""Counts the floating-point operations of one integrator step, and measures the peak performance of one core.

The simulator's kernels compute LANES individuals at once, in "lanes".
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba.core.dispatcher import Dispatcher

from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels import LANES, laws
from wingfit.sim.kernels.arrays import State, Trace, new_work
from wingfit.sim.kernels.integrate import advance
from wingfit.sim.kernels.jit import kernel
from wingfit.sim.kernels.lanes import vector
from wingfit.sim.kernels.lanes.vector import load1, store1
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.solver.scene import at_rest, drive_table, new_trace
from wingfit.sim.virtual_rigs.campaign import robird_wing, tunnel
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.genes import lanes

Array = npt.NDArray[np.float64]

SUMS = (6, 12)  # accumulators that fill the registers of a core with AVX2 and of one with AVX-512


class Counter:
    """Number of floating-point operations so far, summed over all lanes."""

    def __init__(self) -> None:
        self.operations = 0


class Counted:
    """Array [LANES] with one value per lane; arithmetic operations on it are counted in ``counter``."""

    __array_ufunc__ = None  # numpy scalars use the arithmetic of this class

    def __init__(self, value: Array, counter: Counter) -> None:
        self.value, self.counter = value, counter

    def _made(self, value: Array, *, counts: bool = True) -> Counted:
        self.counter.operations += LANES if counts else 0
        return Counted(value, self.counter)

    def __add__(self, other: Counted | float) -> Counted:
        return self._made(self.value + _value(other))

    def __radd__(self, other: float) -> Counted:
        return self._made(other + self.value)

    def __sub__(self, other: Counted | float) -> Counted:
        return self._made(self.value - _value(other))

    def __rsub__(self, other: float) -> Counted:
        return self._made(other - self.value)

    def __mul__(self, other: Counted | float) -> Counted:
        return self._made(self.value * _value(other), counts=not _is_one(other))

    def __rmul__(self, other: float) -> Counted:
        return self._made(other * self.value, counts=not _is_one(other))

    def __truediv__(self, other: Counted | float) -> Counted:
        return self._made(self.value / _value(other))

    def __rtruediv__(self, other: float) -> Counted:
        return self._made(other / self.value)

    def __neg__(self) -> Counted:
        return self._made(-self.value, counts=False)


def _value(x: Counted | float) -> Array | float:
    return x.value if isinstance(x, Counted) else x


def _is_one(x: Counted | float) -> bool:
    return not isinstance(x, Counted) and abs(x) == 1.0


def counting(function: Callable[..., Any], counter: Counter) -> Callable[..., Any]:
    """Return the compiled ``function`` as plain Python that counts its floating-point operations in ``counter``.

    All compiled functions that it calls are replaced in the same way.
    """
    return _Interpreter(counter).plain(function)


class _Interpreter:
    """Replaces compiled functions by their Python source.

    In these functions array elements are read as :class:`Counted`, so that the operations on them are counted.
    """

    def __init__(self, counter: Counter) -> None:
        self.counter = counter
        self.made: dict[Any, Callable[..., Any]] = {}
        self.accessors = {
            getattr(vector, name): function
            for name, function in {
                **dict.fromkeys(("load0", "load1", "load", "load3"), self._load),
                **dict.fromkeys(("store0", "store1", "store", "store3"), self._store),
                "root": lambda x: x._made(np.sqrt(x.value)),
                "magnitude": lambda x: x._made(np.abs(x.value), counts=False),
                "least": lambda x, limit: x._made(np.fmin(x.value, limit), counts=False),
                "greatest": lambda x, limit: x._made(np.fmax(x.value, limit), counts=False),
            }.items()
        }
        self.accessors[laws.call] = _refused

    def plain(self, function: Any) -> Callable[..., Any]:
        if function not in self.made:
            source = function.py_func
            space = dict(source.__globals__)
            again = FunctionType(source.__code__, space, source.__name__, source.__defaults__)
            self.made[function] = again
            for name in source.__code__.co_names:
                if name in space:
                    space[name] = self._replaced(space[name])
        return self.made[function]

    def _replaced(self, thing: Any) -> Any:
        if isinstance(thing, Dispatcher):
            return self.plain(thing)
        try:
            known = self.accessors.get(thing)
        except TypeError:  # not hashable: an array of constants
            return thing
        if known is None and type(thing).__module__.startswith("numba."):
            raise NotImplementedError(
                f"{thing!r} of wingfit.sim.kernels has no counting version; add one to {__name__}"
            )
        return thing if known is None else known

    def _load(self, array: Array, *indices: int) -> Counted:
        return Counted(array[indices].copy(), self.counter)

    @staticmethod
    def _store(array: Array, *rest: Any) -> None:
        *indices, value = rest
        array[tuple(indices)] = _value(value)


def _refused(*_: Any) -> None:
    raise NotImplementedError("laws of effects are called by address and cannot be counted; count a wing without them")


class StepCount(NamedTuple):
    """Result of counting one step.

    ``operations``: floating-point operations of all lanes; ``difference``: relative difference of the state after the
    counted step from the state after the compiled step.
    """

    operations: int
    difference: float


def count_step(division: str) -> StepCount:
    """Count the operations of one integration step of the Robird's wing, moving in air.

    The step is that of :func:`wingfit.sim.kernels.integrate.advance`. ``division``: discretisation into bodies.
    """
    model, condition = FlexibleWing(robird_wing(), division), tunnel(0.05, 3.0, 6.0)
    structure, numerics, steps = model.structure, Numerics(), 96
    nominal = np.array([[gene.nominal for gene in model.genes]])
    scene = WingScene.of(structure, condition, lanes(structure, model.genes, nominal))
    group, here, state = scene.frozen(), scene.setting(steps), at_rest(structure)
    table = drive_table(scene.rods, condition.flap_frequency, numerics, steps, 0)
    run(advance, (structure.wiring, here, group), table[:12], state, new_trace(structure, 12))
    counter, found = Counter(), State(*(part.copy() for part in state))
    run(advance, (structure.wiring, here, group), table[12:13], state, new_trace(structure, 1))
    run(counting(advance, counter), (structure.wiring, here, group), table[12:13], found, new_trace(structure, 1))
    difference = max(float(np.abs(a - b).max() / np.abs(a).max()) for a, b in zip(state, found, strict=True) if a.size)
    return StepCount(counter.operations, difference)


def run(integrate: Callable[..., Any], model: tuple[Any, ...], table: Array, state: State, trace: Trace) -> None:
    """Integrate from ``state``, which is changed, over the rows (steps) of the drive ``table``.

    ``integrate``: the kernel; ``model``: its first arguments, wiring, setting and group; ``trace``: where the motion is
    stored. RuntimeError if a lane diverges.
    """
    alive = np.ones(LANES, bool)
    integrate(*model, table, new_work(*model), state, trace, alive)
    if not alive.all():
        raise RuntimeError("a lane diverged; count with smaller steps")


def peak_gflops(repeats: int = 7, rounds: int = 2_000_000) -> float:
    """Measure the peak rate of one core in 1e9 operations a second; a fused multiply-add counts as two operations.

    Best of ``repeats`` repetitions of a loop of ``rounds`` rounds.
    """
    best = 0.0
    for sums, function in zip(SUMS, (_few, _many), strict=True):
        data = np.zeros((sums + 2, LANES))
        data[sums], data[sums + 1] = 0.999, 0.5
        function(data, 10)
        for _ in range(repeats):
            start = time.thread_time()
            function(data, rounds)
            best = max(best, 2 * LANES * sums * rounds / (time.thread_time() - start) / 1e9)
    return best


@kernel
def _few(data: Array, rounds: int) -> None:
    """Repeat a = a x + y ``rounds`` times for six independent rows a of ``data`` [8, LANES]; x, y are its last rows."""
    x, y = load1(data, 6), load1(data, 7)
    a, b, c, d, e, f = load1(data, 0), load1(data, 1), load1(data, 2), load1(data, 3), load1(data, 4), load1(data, 5)
    for _ in range(rounds):
        a, b, c, d, e, f = a * x + y, b * x + y, c * x + y, d * x + y, e * x + y, f * x + y
    store1(data, 0, a)
    store1(data, 1, b)
    store1(data, 2, c)
    store1(data, 3, d)
    store1(data, 4, e)
    store1(data, 5, f)


@kernel
def _many(data: Array, rounds: int) -> None:
    """Repeat a = a x + y ``rounds`` times for twelve rows a of ``data`` [14, LANES]; x, y are its last two rows."""
    x, y = load1(data, 12), load1(data, 13)
    a, b, c, d, e, f = load1(data, 0), load1(data, 1), load1(data, 2), load1(data, 3), load1(data, 4), load1(data, 5)
    g, h, i, j, k, m = load1(data, 6), load1(data, 7), load1(data, 8), load1(data, 9), load1(data, 10), load1(data, 11)
    for _ in range(rounds):
        a, b, c, d, e, f = a * x + y, b * x + y, c * x + y, d * x + y, e * x + y, f * x + y
        g, h, i, j, k, m = g * x + y, h * x + y, i * x + y, j * x + y, k * x + y, m * x + y
    store1(data, 0, a)
    store1(data, 1, b)
    store1(data, 2, c)
    store1(data, 3, d)
    store1(data, 4, e)
    store1(data, 5, f)
    store1(data, 6, g)
    store1(data, 7, h)
    store1(data, 8, i)
    store1(data, 9, j)
    store1(data, 10, k)
    store1(data, 11, m)


def main() -> None:
    """Parse the command line, and print the operations of a step and the peak rate."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.physics.flops", description=__doc__)
    parser.add_argument("--division", default="24", help="discretisation: a preset such as 24, or 6x4, or 3,3,3,2")
    division = parser.parse_args().division
    counted = count_step(division)
    print(f"{counted.operations / LANES:.0f} operations a step and individual, {division} bodies")
    print(f"the same step compiled differs by {counted.difference:.1e}, relative")
    print(f"{peak_gflops():.0f} GFLOP/s in a loop of fused multiply-adds")


if __name__ == "__main__":
    main()
