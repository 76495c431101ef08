"""What the simulation of a rig computes: one recording, with the laws that act at its ports."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import scipy

from wingfit.records.array_types import Array, ArrayLike, Float
from wingfit.rigs.lsoda import lsoda
from wingfit.rigs.ports import Law, Values

RTOL = 1e-8
ATOL = 1e-9  # of the largest initial value, at least ATOL_LEAST
ATOL_LEAST = 1e-12
ESCAPED = 1e100  # in any unit: a state that large has escaped to infinity, which a solver never reaches
FEW = 24  # states
MOST_RATES = 200_000  # evaluations of the rate in one integration, and
RATES_PER_SAMPLE = 1_000  # more for a long recording: a solver that needs more makes no progress
BADLY_SCALED = 1e-6  # of the largest value of a state: if the absolute tolerance is more, it is set for each state


class SimulationError(ValueError):
    """Raised by a simulation that cannot be computed; its message becomes the reason of the individual's failure."""


@dataclass(eq=False)
class Run:
    """One simulation: the instants, settings and inputs of a recording, and what is added to the model.

    Attributes:
        recording: name of the recording.
        times: [T], s, at which channels are wanted, increasing.
        settings: by name, as the dataset states them.
        inputs: samples of each input by name, at ``input_times`` [N].
        input_times: [N], s.
    """

    recording: str
    times: Float[Array, " T"]
    settings: Mapping[str, float]
    inputs: Mapping[str, Array]
    input_times: Float[Array, " N"]
    values: Values = field(default_factory=dict)
    laws: Mapping[str, Sequence[Law]] = field(default_factory=dict)
    _memory: list[float] = field(default_factory=list)
    _slip: list[float] = field(default_factory=list)
    _integrates: bool = False

    def setting(self, name: str) -> float:
        """Return the setting called ``name``; SimulationError if the recording does not state it."""
        if name not in self.settings:
            have = ", ".join(self.settings) or "none"
            raise SimulationError(f"recording {self.recording!r} states no setting {name!r}; it has {have}")
        return self.settings[name]

    def input(self, name: str, times: ArrayLike) -> Array:
        """Return the input called ``name`` at ``times`` (s, any shape), linear between samples and constant beyond."""
        if name not in self.inputs:
            have = ", ".join(self.inputs) or "none"
            raise SimulationError(f"recording {self.recording!r} has no input {name!r}; it has {have}")
        return np.asarray(np.interp(np.asarray(times, float), self.input_times, self.inputs[name]))

    def force(self, port: str, coordinate: float, rate: float) -> float:
        """Return the force of the laws that were added at ``port``, for a ``coordinate`` and its ``rate``.

        It is zero unless a law was added. Add it to the force that accelerates the coordinate.
        """
        total = 0.0
        for law in self.laws.get(port, ()):
            state = 0.0
            if law.slip is not None:
                if not self._integrates:
                    raise SimulationError(f"{law.suspect.name} has a memory: call force within Run.integrate")
                place = self._place(law)
                state = self._memory[place]
                self._slip[place] = law.slip(self.values, coordinate, rate, state)
            total += law.force(self.values, coordinate, rate, state)
        return total

    def integrate(
        self,
        rate: Callable[[float, Array], ArrayLike],
        start: ArrayLike,
        *,
        steps: int = 0,
        method: str = "LSODA",
        rtol: float = RTOL,
        atol: float | None = None,
    ) -> Float[Array, "N T"]:
        """Integrate d(state)/dt = ``rate(t, state)`` from ``start`` [N] at the first of ``times``; returns [N, T].

        With ``steps``, so many Runge-Kutta steps of fourth order from each of ``times`` to the next: fast where inputs
        are sampled, whose kinks cost an error control many steps, but without a check of the error. Otherwise scipy's
        ``method`` with the relative tolerance ``rtol`` and the absolute one ``atol`` (None: ATOL of the largest value
        in ``start``). SimulationError where it fails.
        """
        first, times = np.atleast_1d(np.asarray(start, float)), np.asarray(self.times, float)
        self._memory = [0.0] * len(self._remembering)
        self._slip = [0.0] * len(self._remembering)
        if len(times) < 2:
            return first[:, None] + np.zeros(len(times))
        whole, guarded = np.concatenate([first, self._memory]), self._guarded(rate, len(first))
        self._integrates = True
        try:
            if steps > 0:
                return runge_kutta(guarded, whole, times, steps)[: len(first)]
            tolerance = max(ATOL * float(np.abs(first).max()), ATOL_LEAST) if atol is None else atol
            found = self._solved(guarded, whole, method, rtol, np.full(len(whole), tolerance))
            largest = np.abs(found).max(axis=1)
            if atol is None and (tolerance > BADLY_SCALED * largest[largest > 0.0]).any():  # states of different size
                each = np.where(largest > 0.0, ATOL * largest, tolerance)
                found = self._solved(self._guarded(rate, len(first)), whole, method, rtol, np.minimum(each, tolerance))
        finally:
            self._integrates = False
        return found[: len(first)]

    def _solved(
        self, rate: Callable[[float, Array], ArrayLike], start: Array, method: str, rtol: float, atol: Array
    ) -> Array:
        """Integrate with an error control, in steps no longer than the interval of an input, so that none is missed."""
        times = np.asarray(self.times, float)
        spacing = float(np.min(np.diff(self.input_times))) if self.inputs else np.inf
        if method == "LSODA":
            states, failed = lsoda(rate, start, times, rtol, atol, spacing)
            if failed is not None:
                raise SimulationError(f"the integration fails: {failed}")
            return states
        found = scipy.integrate.solve_ivp(
            rate, (times[0], times[-1]), start, method, times, rtol=rtol, atol=atol, max_step=spacing
        )
        if not found.success:
            raise SimulationError(f"the integration fails: {found.message}")
        return np.asarray(found.y)

    def _guarded(self, rate: Callable[[float, Array], ArrayLike], size: int) -> Callable[[float, Array], ArrayLike]:
        """Return the rate of ``size`` states and of the laws' memories; it ends integrations that would never end."""
        most, calls, remembering = max(MOST_RATES, RATES_PER_SAMPLE * len(self.times)), 0, bool(self._remembering)

        def guarded(t: float, state: Array) -> ArrayLike:
            nonlocal calls
            calls += 1
            if calls > most:
                raise SimulationError(f"the integration makes no progress at {t:.6g} s; {most} rates were evaluated")
            if _escaped(state):
                raise SimulationError(f"the motion grows without bound: its state escapes at {t:.6g} s")
            if not remembering:
                return rate(t, state)
            self._memory = state[size:].tolist()
            return np.concatenate([np.asarray(rate(t, state[:size]), float).ravel(), self._slip])

        return guarded

    @property
    def _remembering(self) -> list[Law]:
        """The laws with a memory, in the order of their states."""
        return [law for own in self.laws.values() for law in own if law.slip is not None]

    def _place(self, law: Law) -> int:
        return next(k for k, one in enumerate(self._remembering) if one is law)


def _escaped(state: Array) -> bool:
    """Return whether a value is beyond ESCAPED, or not a number; for few states, numpy is slower than a loop."""
    if len(state) > FEW:
        return not (state.max() < ESCAPED and state.min() > -ESCAPED)
    return any(not -ESCAPED < value < ESCAPED for value in state.tolist())


def runge_kutta(
    rate: Callable[[float, Array], ArrayLike], start: Float[Array, " N"], times: Float[Array, " T"], steps: int
) -> Float[Array, "N T"]:
    """Integrate from ``start`` [N] by ``steps`` steps of the classical method of fourth order between ``times`` [T]."""
    found, state = np.empty((len(start), len(times))), start
    found[:, 0] = start
    for k, (begin, end) in enumerate(pairwise(times.tolist()), 1):
        h = (end - begin) / steps
        for j in range(steps):
            t = begin + j * h
            a = np.asarray(rate(t, state))
            b = np.asarray(rate(t + 0.5 * h, state + 0.5 * h * a))
            c = np.asarray(rate(t + 0.5 * h, state + 0.5 * h * b))
            d = np.asarray(rate(t + h, state + h * c))
            state = state + h / 6.0 * (a + 2.0 * (b + c) + d)
        found[:, k] = state
    return found
