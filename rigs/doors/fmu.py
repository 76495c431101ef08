"""A door to an FMU: a model that another tool exported for co-simulation (FMI 2.0 or 3.0), by FMPy.

``pip install 'wingfit[fmu]'``. An FMU holds machine code, which runs in this process: use only one that you trust.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import threading
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from wingfit.records.array_types import Array, Float, Index, Int
from wingfit.rigs.doors.door import DoorError, checked, named, short, value_of
from wingfit.rigs.doors.fmu_instance import Instance, Variables, load
from wingfit.rigs.run import Run, SimulationError

EVEN = 1e-6  # of a step: steps that differ by less count as equal
MOST_STEPS = 10_000_000


def fmu(
    file: str | os.PathLike[str],
    channels: Sequence[str] | Mapping[str, str],
    parameters: Sequence[str] | Mapping[str, str],
    inputs: Sequence[str] | Mapping[str, str] = (),
    *,
    step: float | None = None,
    tolerance: float | None = None,
    reuse: bool = True,
) -> Fmu:
    """Return a ``simulate`` that runs the FMU ``file`` from the first of the times to the last.

    Names are those of the rig; a mapping gives the FMU's own variable for each ({"angle": "body.phi"}).

    Args:
        file: path of the FMU, on every machine that simulates.
        channels: outputs of the FMU, in the channel's unit.
        parameters: genes and settings that are parameters of the FMU, set before it is initialised.
        inputs: inputs of the run that are inputs of the FMU. The FMU gets them as linear between samples if it can
            interpolate, else each step gets the value at its middle.
        step: s, longest communication step; one step between two times if not given. Choose it so short that the
            channels change little when it is halved. An FMU that needs equal steps gets equal ones, and its outputs
            are interpolated (by a cubic spline) where times are uneven.
        tolerance: relative tolerance of the FMU's own integration; its own choice if not given.
        reuse: whether one instance is reset between simulations. The first simulation is done twice, and if the numbers
            are not the same after a reset, every simulation gets a new instance anyway.
    """
    if step is not None and not step > 0.0:
        raise DoorError(f"step is {step!r}; give a positive number of seconds")
    variables = Variables(named(channels, "channels"), named(parameters, "parameters"), named(inputs, "inputs"))
    return Fmu(str(Path(file).absolute()), variables, step, tolerance, reuse)


@dataclass(frozen=True, eq=False)
class Fmu:
    """Simulates with an FMU; see :func:`fmu`, which checks the arguments."""

    file: str
    variables: Variables
    step: float | None
    tolerance: float | None
    reuse: bool
    _own: _Unpacked = field(init=False, default_factory=lambda: _Unpacked())

    def __getstate__(self) -> dict[str, Any]:
        """Pickle everything but the instance: another process unpacks the file and makes its own."""
        return {**self.__dict__, "_own": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _own=_Unpacked())

    def __call__(self, genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        """Return the channels [T] of ``run`` for ``genes``, as the FMU computes them."""
        values = {own: value_of(name, genes, run) for name, own in self.variables.parameters.items()}
        for name in self.variables.inputs:
            if name not in run.inputs:
                have = ", ".join(run.inputs) or "none"
                raise DoorError(f"recording {run.recording!r} has no input {name!r}, which inputs names; it has {have}")
        with self._own.lock:
            found = self._reproducible(values, run)
        names = list(self.variables.channels)
        return checked(dict(zip(names, found.T, strict=True)), names, len(run.times), Path(self.file).name)

    def _reproducible(self, values: Mapping[str, float], run: Run) -> Float[Array, "T C"]:
        """Return the channels [T, C], which do not depend on earlier simulations."""
        own = self._own
        if own.pid != os.getpid():
            own.open(self)
        found = self._simulated(values, run)
        if own.resets is None:
            own.resets = bool(self.reuse) and np.array_equal(found, self._simulated(values, run), equal_nan=True)
        if not own.resets:
            own.drop()
        return found

    def _simulated(self, values: Mapping[str, float], run: Run) -> Float[Array, "T C"]:
        instance = self._own.instance()
        try:
            return self._steps(instance, values, run)
        except instance.failure as error:
            self._own.drop(free=instance.may_be_freed(error))
            said = [str(error).rstrip("."), *instance.messages[-3:]]
            raise SimulationError(f"the FMU fails: {short(': '.join(said))}") from error
        except BaseException:
            self._own.drop()
            raise

    def _steps(self, instance: Instance, values: Mapping[str, float], run: Run) -> Float[Array, "T C"]:
        times = np.asarray(run.times, float)
        grid, kept = self._grid(times, instance.even)
        instance.begin(values, float(times[0]), self.tolerance)
        found = np.empty((len(grid), len(self.variables.channels)))
        middles = 0.5 * (grid[1:] + grid[:-1])
        nodes, between = self._input_values(run, grid), self._input_values(run, middles)
        slopes = np.diff(nodes, axis=0) / np.diff(grid)[:, None]
        instance.set_inputs(nodes[0])
        instance.finish_start()
        found[0] = instance.outputs()
        for k in range(len(grid) - 1):
            if instance.interpolates:
                instance.set_slopes(slopes[k])
            else:
                instance.set_inputs(between[k])
            instance.advance(float(grid[k]), float(grid[k + 1] - grid[k]))
            instance.set_inputs(nodes[k + 1])
            found[k + 1] = instance.outputs()
        if kept is not None:
            return np.asarray(found[kept])
        return np.asarray(scipy.interpolate.make_interp_spline(grid, found, min(3, len(grid) - 1))(times))

    def _input_values(self, run: Run, times: Array) -> Float[Array, "N U"]:
        columns = [run.input(name, times) for name in self.variables.inputs]
        return np.stack(columns, axis=1) if columns else np.zeros((len(times), 0))

    def _grid(self, times: Array, even: bool) -> tuple[Array, Int[Index, " T"] | None]:
        """Return the communication points, and which of them are ``times``; None: the outputs are interpolated."""
        gaps = np.diff(times)
        if not len(gaps):
            return times, np.arange(len(times), dtype=np.int64)
        longest = self.step or np.inf
        if even and np.ptp(gaps) > EVEN * gaps.min():
            count = int(np.ceil((times[-1] - times[0]) / min(longest, gaps.min()) - EVEN))
            _check_count(count)
            return np.linspace(times[0], times[-1], count + 1), None
        parts = np.maximum(np.ceil(gaps / longest - EVEN), 1.0).astype(np.int64)
        if even:
            parts[:] = parts.max()
        _check_count(int(parts.sum()))
        firsts = np.repeat(times[:-1], parts)
        kept = np.append(np.int64(0), np.cumsum(parts))
        within = np.arange(len(firsts)) - np.repeat(kept[:-1], parts)
        return np.append(firsts + within * np.repeat(gaps / parts, parts), times[-1]), kept


def _check_count(count: int) -> None:
    if count > MOST_STEPS:
        raise DoorError(f"a simulation needs {count} steps; give a longer step, or fewer times")


class _Unpacked:
    """The FMU as this process has it: unpacked, with one instance at most; both go with the object that owns them."""

    def __init__(self) -> None:
        self.pid = 0
        self.lock = threading.Lock()
        self.resets: bool | None = None
        self._held: list[Instance] = []

    def open(self, door: Fmu) -> None:
        """Unpack the file; DoorError if it is no FMU that can be used."""
        folder = tempfile.mkdtemp(prefix="wingfit-fmu-")
        self._held = []  # instances of the process that this one was forked from are left alone
        weakref.finalize(self, _removed, folder, self._held, os.getpid())
        self._make = load(door.file, folder, door.variables)
        self.pid, self.resets = os.getpid(), None

    def instance(self) -> Instance:
        """Return an instance that is as new: the one that there is, after a reset, or another."""
        if self._held and not self._held[0].reset():
            self.drop()
        if not self._held:
            self._held.append(self._make())
        return self._held[0]

    def drop(self, free: bool = True) -> None:
        """Free the instance; without ``free``, only forget it: after a fatal error it must not be called."""
        while self._held:
            made = self._held.pop()
            if free:
                made.free()


def _removed(folder: str, held: list[Instance], owner: int) -> None:
    if os.getpid() != owner:
        return
    while held:
        held.pop().free()
    shutil.rmtree(folder, ignore_errors=True)
