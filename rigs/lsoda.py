"""LSODA (Petzold 1983) without Python between its steps: several times as fast as ``solve_ivp`` for few states."""

from __future__ import annotations

import threading
from collections.abc import Callable
from types import FunctionType

import numpy as np
from scipy.integrate import odeint, solve_ivp

from wingfit.records.array_types import Array, ArrayLike, Float

MOST_STEPS = 10**8  # from one instant to the next: the rate itself ends an integration without progress

# Python allocates the frames of functions in chunks of 16 KiB. Where the end of a chunk happens to lie between the
# solver and the rate, every evaluation of the rate allocates a chunk and frees it, which doubles the time. A frame of
# this size fits into no such chunk: it gets one of 64 KiB, in which 40 KiB are left for the frames of the rate.
FRAME_SLOTS = 3100

# Older versions of scipy keep the state of this solver in global memory.
_one_at_a_time = threading.RLock()
_thread = threading.local()


def lsoda(
    rate: Callable[[float, Array], ArrayLike],
    start: Float[Array, " N"],
    times: Float[Array, " T"],
    rtol: float,
    atol: Float[Array, " N"],
    longest: float,
) -> tuple[Float[Array, "N T"], str | None]:
    """Integrate d(state)/dt = ``rate(t, state)`` from ``start`` [N]; returns states [N, T], and why it failed, or None.

    ``rtol``, ``atol`` [N]: tolerances; ``longest``: step (s), infinity without a limit. No rate is evaluated beyond the
    last of ``times`` [T]. What ``rate`` raises is passed on. Within the rate of another integration, DOP853 is used.
    Threads integrate one after the other, so a rate must not wait for another thread that integrates.
    """
    with _one_at_a_time:
        if getattr(_thread, "solving", False):
            return _explicit(rate, start, times, rtol, atol, longest)
        _thread.solving = True
        try:
            return _solved_with_room(rate, start, times, rtol, atol, longest)
        finally:
            _thread.solving = False


def _explicit(
    rate: Callable[[float, Array], ArrayLike], start: Array, times: Array, rtol: float, atol: Array, longest: float
) -> tuple[Array, str | None]:
    found = solve_ivp(rate, (times[0], times[-1]), start, "DOP853", times, rtol=rtol, atol=atol, max_step=longest)
    return np.asarray(found.y), None if found.success else str(found.message)


def _solved(
    rate: Callable[[float, Array], ArrayLike], start: Array, times: Array, rtol: float, atol: Array, longest: float
) -> tuple[Array, str | None]:
    states, known = odeint(
        lambda t, state: rate(t, np.array(state)),  # its own array is the solver's memory
        start,
        times,
        tfirst=True,
        full_output=True,
        rtol=rtol,
        atol=atol,
        tcrit=times[-1:],
        hmax=longest if np.isfinite(longest) else 0.0,
        mxstep=MOST_STEPS,
    )
    failed = None if known["message"] == "Integration successful." else str(known["message"])
    return np.asarray(states).T, failed


_solved_with_room: Callable[..., tuple[Array, str | None]] = FunctionType(
    _solved.__code__.replace(co_stacksize=FRAME_SLOTS), globals(), _solved.__name__
)
