"""The integrator on a structure as it stands, and structures with only some of their connectors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wingfit.records import Condition, FourierDrive, Hinge, Marker, Materials, Rod, Station, Wing
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import STAGES, Lanes, Setting, State, Trace, new_work
from wingfit.sim.kernels.integrate import advance
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.solver.scene import drive_table, new_trace
from wingfit.sim.wing.drive import RodDrive
from wingfit.sim.wing.structure import Structure

Array = npt.NDArray[np.float64]

ORDER = 4  # of the integrator, as it declares
STIFF_ORDER = 3  # where springs are much too fast for the step
LENGTH, CHORD, THICKNESS, DENSITY = 0.5, 0.05, 0.02, 40.0
STILL = FourierDrive(0.0, (), ())


def plank(drive: FourierDrive = STILL, hinge: Hinge = Hinge(0.0, 0.0)) -> Wing:  # noqa: B008 (frozen)
    """A uniform foam plank with rods too light and too soft to matter."""
    rods = tuple(Rod(n, x, 0.0, x, LENGTH, 1e-5, 1.0, 0.0) for n, x in (("front", 0.01), ("rear", 0.04)))
    stations = tuple(Station(y, 0.0, CHORD, THICKNESS) for y in (0.0, LENGTH))
    tip = Marker("tip", (CHORD / 2, LENGTH - 1e-9, 0.0), 1e-12)
    return Wing(
        "plank", stations, Materials(DENSITY, 0.0), rods, ("front", "rear"), (tip,), ("tip",), hinge, drive
    )  # fmt: skip


def march(
    structure: Structure, group: Lanes, here: Setting, state: State, steps: int, table: Array | None = None
) -> Trace:
    """Integrate ``steps`` equal steps from ``state``, in place; the motion is kept. No lane may diverge."""
    trace, alive = new_trace(structure, steps, with_motion=True, states=len(state.z)), np.ones(LANES, bool)
    still = np.zeros((steps, STAGES, 2, 3, LANES)) if table is None else table
    advance(structure.wiring, here, group, still, new_work(structure.wiring, here, group), state, trace, alive)
    assert alive.all()
    return trace


def vacuum_here(step: float, gravity: float = 0.0) -> Setting:
    """No air."""
    return Setting(np.zeros(LANES), np.zeros((3, LANES)), gravity, step)


def driven(structure: Structure, condition: Condition, steps: int, beats: int, *, compliant: bool = False) -> Array:
    """The drive of the first ``beats`` with ``steps`` each, ramped up over the first."""
    rods, numerics = RodDrive.of(structure.wing.drive, condition.phase_lag, LANES), Numerics(steps=steps)
    frequency = condition.flap_frequency
    tables = [drive_table(rods, frequency, numerics, steps, beat, compliant=compliant) for beat in range(beats)]
    return np.concatenate(tables)


def with_connectors(structure: Structure, group: Lanes, kept: npt.NDArray[np.bool_]) -> tuple[Structure, Lanes]:
    """The structure with all other springs and dampers cut, those to the rods all or none; its arrays are its own."""
    w = structure.wiring
    wiring = w._replace(
        first=w.first[kept], second=w.second[kept], lower=w.lower[kept], upper=w.upper[kept], a=w.a[kept], b=w.b[kept],
        mass=w.mass.copy(), inertia=w.inertia.copy(), driven=int((w.first[kept] < len(w.mass)).sum()),
    )  # fmt: skip
    connectors = tuple(c for c, keep in zip(structure.connectors, kept, strict=True) if keep)
    springs = group._replace(stiffness=group.stiffness[kept], damping=group.damping[kept])
    return replace(structure, connectors=connectors, wiring=wiring), springs


def turned(structure: Structure, state: State, angle: float) -> None:
    """Turn the whole wing rigidly by ``angle`` about the x axis through the origin."""
    c, s = np.cos(angle), np.sin(angle)
    n = len(structure.bodies)
    R = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    state.R[:n] = R.ravel()[None, :, None]
    state.p[:n] = np.einsum("ij,njw->niw", R, state.p[:n])


def order(errors: list[float], refinement: float = 2.0) -> float:
    """Observed order from errors at step sizes that fall by ``refinement``: that of the last pair."""
    return float(np.log(errors[-2] / errors[-1]) / np.log(refinement))
