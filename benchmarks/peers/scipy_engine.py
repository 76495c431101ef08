"""Simulation of the wing with scipy's stiff integrators and the equations of :mod:`.equations`; each beat is timed."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.integrate import BDF, LSODA, OdeSolution, OdeSolver, Radau

from benchmarks.peers.equations import at_rest, marker_tracks, right_hand_side, sparsity
from benchmarks.peers.wing import PeerWing

Array = npt.NDArray[np.float64]

METHODS = {"Radau": Radau, "BDF": BDF, "LSODA": LSODA}
_LENGTH = 0.1  # m, about a chord: relates the absolute tolerances of rotations and displacements


class OutOfTimeError(RuntimeError):
    """The run was stopped at its time limit."""


@dataclass(frozen=True)
class Run:
    """Result of a simulation of some beats from rest.

    Attributes:
        times: [T] start of the run, then end of every step, s.
        states: [T, 13 N] of the N bodies, as in :mod:`.equations`.
        cpu: [beats] processor time of each beat, s.
        between: the integrator's interpolation between steps, if it was kept, else None.
    """

    times: Array
    states: Array
    cpu: Array
    between: OdeSolution | None


def simulate(
    wing: PeerWing,
    method: str,
    tolerance: float,
    *,
    beats: int = 2,
    keep: bool = False,
    clock: Callable[[], None] = lambda: None,
) -> Run:
    """Integrate ``beats`` beats from rest with scipy's ``method``.

    ``tolerance``: relative tolerance; the absolute ones are ``tolerance`` times typical values of the state. ``clock``
    is called after every step and may raise :class:`OutOfTimeError`. ``keep``: whether to store the interpolation.
    """
    period = 2 * np.pi / wing.omega
    solver = _solver(wing, method, tolerance, beats * period)
    times, states, pieces, marks = [0.0], [solver.y.copy()], [], [time.process_time()]
    while solver.status == "running":
        message = solver.step()
        if solver.status == "failed":
            raise ArithmeticError(f"scipy's {method} at tolerance {tolerance:g} gave up at {solver.t:g} s: {message}")
        clock()
        times.append(solver.t)
        states.append(solver.y.copy())
        if keep:
            pieces.append(solver.dense_output())
        if solver.t >= len(marks) * period * (1 - 1e-12):
            marks.append(time.process_time())
    between = OdeSolution(np.array(times), pieces) if keep else None
    return Run(np.array(times), np.array(states), np.diff(marks), between)


def _solver(wing: PeerWing, method: str, tolerance: float, end: float) -> OdeSolver:
    omega = wing.omega
    scale = np.array([_LENGTH] * 3 + [1.0] * 4 + [_LENGTH * omega] * 3 + [omega] * 3)
    options = {} if method == "LSODA" else {"jac_sparsity": sparsity(wing), "vectorized": True}
    return METHODS[method](
        lambda t, y: right_hand_side(wing, t, y),
        0.0, at_rest(wing), end,
        rtol=tolerance, atol=tolerance * np.tile(scale, len(wing.mass)), **options,
    )  # fmt: skip


@dataclass(frozen=True)
class Cost:
    """Processor time of one beat, and the largest error of a marker (mm).

    ``method``, ``settings``: integrator and its tolerances or steps. Without a result, ``cpu_ms_per_beat`` is None and
    ``note`` gives the reason.
    """

    cpu_ms_per_beat: float | None
    error_mm: float | None
    method: str
    settings: dict[str, float]
    note: str = ""


def deadline(seconds: float) -> Callable[[], None]:
    """Return a function that raises :class:`OutOfTimeError` if it is called more than ``seconds`` from now."""
    end = time.monotonic() + seconds

    def check() -> None:
        if time.monotonic() > end:
            raise OutOfTimeError(f"not finished within {seconds:g} s; allow more time")

    return check


def error_against(wing: PeerWing, run: Run, reference: Run) -> float:
    """Return the largest distance (m) of a marker in ``run`` from ``reference`` at the steps of the last beat.

    The times are those of the steps of ``run``; only the reference is interpolated, and must have been run with
    keep=True.
    """
    if reference.between is None:
        raise ValueError("the reference was run without its interpolation; simulate it with keep=True")
    last = run.times >= run.times[-1] - 2 * np.pi / wing.omega
    there = reference.between(run.times[last]).T
    return float(np.linalg.norm(marker_tracks(wing, run.states[last]) - marker_tracks(wing, there), axis=-1).max())


def cheapest(
    wing: PeerWing,
    tolerance_mm: float,
    *,
    methods: Sequence[str] = ("LSODA", "BDF", "Radau"),
    tolerances: Sequence[float] = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6),
    converged: float = 1e-6,
    seconds: float = 600.0,
) -> Cost:
    """Measure the cheapest beat after the start-up ramp with markers within ``tolerance_mm`` of a converged run.

    The converged run uses Radau with the tolerance ``converged``. For each of ``methods`` the loosest two neighbouring
    ``tolerances`` that both suffice are measured, because the errors of BDF and LSODA are erratic and a single
    tolerance may suffice by chance; the cheaper one counts. ``seconds``: time limit for everything. Without a result,
    the returned Cost gives the reason.
    """
    clock = deadline(seconds)
    try:
        reference = simulate(wing, "Radau", converged, keep=True, clock=clock)
    except OutOfTimeError as late:
        return Cost(None, None, "Radau", {"rtol": converged}, f"converged run {late}")
    found, late_ones = [], ""
    for method in methods:
        try:
            found += _sufficient(wing, method, tolerances, tolerance_mm, reference, clock)
        except OutOfTimeError as late:
            late_ones = f"{method} {late}"
            break
    if not found:
        return Cost(
            None, None, ", ".join(methods), {}, late_ones or f"no tolerance down to {tolerances[-1]:g} suffices"
        )
    return replace(min(found, key=lambda cost: cost.cpu_ms_per_beat or np.inf), note=late_ones)


def _sufficient(
    wing: PeerWing,
    method: str,
    tolerances: Sequence[float],
    tolerance_mm: float,
    reference: Run,
    clock: Callable[[], None],
) -> list[Cost]:
    """Return the costs with the two loosest neighbouring ``tolerances`` whose errors are at most ``tolerance_mm``.

    ``clock``: as for :func:`simulate`. One cost or none is returned if too few tolerances suffice.
    """
    found: list[Cost] = []
    for tolerance in tolerances:
        try:
            run = simulate(wing, method, tolerance, clock=clock)
            error = 1e3 * error_against(wing, run, reference)
        except ArithmeticError:
            error = np.inf
        if error > tolerance_mm:
            found = []
            continue
        steps = float(np.sum(run.times > run.times[-1] - 2 * np.pi / wing.omega))
        found.append(Cost(1e3 * float(run.cpu[-1]), error, method, {"rtol": tolerance, "steps_per_beat": steps}))
        if len(found) == 2:
            break
    return found
