"""Forces on a flapping pair of wings by the unsteady ring vortex lattice of PteraSoftware; run by :mod:`.simulate`.

A script for the interpreter that has PteraSoftware 5 (MIT licence). It reads one JSON object from standard input and
writes one to standard output. The method is that of Katz and Plotkin (2001), Low-Speed Aerodynamics, sect. 13.12, with
the force of each vortex segment by the Kutta-Joukowski theorem, and rho dGamma/dt on each panel. The wings are thin,
flat across the chord and have attached flow; the wake moves with the stream ("prescribed") or also with the velocity
that the vortices induce ("free").
"""

from __future__ import annotations

import importlib.metadata
import json
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

PACKAGE = "pterasoftware"
MAJOR = "5"  # version whose axes and solver this script relies on
LIKE = 1e-9  # m, agreement of the lattice's corners with those wanted
EXTRA = 3  # steps after the last beat, so that central differences there are not one-sided


@dataclass(frozen=True)
class Request:
    """What to simulate. SI units and radians; a beat has n steps.

    Attributes:
        r, chord: [J + 1] distance from the flapping axis and chord of J panels' edges along the span, root first, m.
        pitch_axis: distance of the axis of pitch behind the leading edge, in chords.
        down: [n] angle of the wings below the horizontal.
        pitch: [n] pitch at the tip; pi/2 is a chord along the body, a larger pitch raises the leading edge.
        root_pitch: pitch at the flapping axis; between it and the tip, pitch is linear in r.
        frequency, density, airspeed: Hz, kg/m^3, m/s.
        incidence: angle of the body to the stream; positive with the nose up.
        panels: number of panels along the chord.
        beats: number of beats to simulate; the forces are those of the last.
        wake: length of the wake, beats.
        free: whether the wake moves with the velocity that vortices induce.
    """

    r: Array
    chord: Array
    pitch_axis: float
    down: Array
    pitch: Array
    root_pitch: float
    frequency: float
    density: float
    airspeed: float
    incidence: float
    panels: int
    beats: int
    wake: float
    free: bool

    @classmethod
    def of(cls, given: dict[str, Any]) -> Request:
        """Return the request of a JSON object; ValueError if a field is missing, unknown or out of range."""
        names = {one.name for one in fields(cls)}
        if set(given) != names:
            raise ValueError(f"the request has the fields {sorted(given)}; it needs {sorted(names)}")
        arrays = {name: np.array(given[name], float) for name in ("r", "chord", "down", "pitch")}
        whole = cls(**{**given, **arrays})
        whole.check()
        return whole

    def check(self) -> None:
        """Raise ValueError if lengths disagree or a value is out of range."""
        if len(self.r) < 2 or len(self.r) != len(self.chord) or len(self.down) != len(self.pitch):
            raise ValueError("r and chord need one value per edge, at least two; down and pitch one per step of a beat")
        if len(self.down) < 4:
            raise ValueError(f"a beat has {len(self.down)} steps; it needs at least 4")
        if self.r[0] != 0.0 or not (np.diff(self.r) > 0.0).all():
            raise ValueError("r must start at 0 and increase")
        positive = {"chord": self.chord.min(), "frequency": self.frequency, "density": self.density}
        positive |= {"airspeed": self.airspeed, "panels": self.panels, "beats": self.beats, "wake": self.wake}
        for name, value in positive.items():
            if not value > 0.0:
                raise ValueError(f"{name} is {value:g}; it must be positive")
        if not all(np.isfinite(a).all() for a in (self.r, self.chord, self.down, self.pitch)):
            raise ValueError("r, chord, down and pitch must be finite")

    def edges(self, step: int) -> tuple[Array, Array]:
        """Leading edge [J + 1, 3] (m) and axes [J + 1, 3, 3] of the right wing's sections at ``step`` of the beat.

        In geometry axes: x aft, y to the right, z up. The axes are rows: aft along the chord, outward along the span,
        and normal to both. The section at the flapping axis is not turned by the flap angle, so that both wings join.
        """
        share = self.r / self.r[-1]
        pitch = self.root_pitch + (self.pitch[step] - self.root_pitch) * share
        down = np.where(self.r > 0.0, self.down[step], 0.0)
        zero, sin, cos = np.zeros(len(down)), np.sin(down), np.cos(down)
        aft = np.stack([np.sin(pitch), np.cos(pitch) * sin, np.cos(pitch) * cos], axis=1)
        out = np.stack([zero, cos, -sin], axis=1)
        lead = self.r[:, None] * out - self.pitch_axis * self.chord[:, None] * aft
        return lead, np.stack([aft, out, np.cross(aft, out)], axis=1)


def euler(turn: Array) -> Array:
    """Intrinsic x, y', z'' angles [3] (deg) of the axes in the rows of ``turn`` [3, 3], in axes of the parent."""
    across = turn.T  # its columns are the axes
    y = math.asin(min(1.0, max(-1.0, across[0, 2])))
    x = math.atan2(-across[1, 2], across[2, 2])
    z = math.atan2(-across[0, 1], across[0, 0])
    return np.degrees([x, y, z])


def airplane(ps: Any, request: Request, step: int, foil: Any) -> Any:
    """PteraSoftware's airplane with both wings at ``step`` of the beat; RuntimeError if its corners are elsewhere."""
    lead, axes = request.edges(step)
    sections = []
    for k, chord in enumerate(request.chord):
        before = max(k - 1, 0)
        last = k == len(request.r) - 1
        sections.append(
            ps.geometry.wing_cross_section.WingCrossSection(
                airfoil=foil,
                num_spanwise_panels=None if last else 1,
                chord=float(chord),
                Lp_Wcsp_Lpp=axes[before] @ (lead[k] - lead[before]) if k else np.zeros(3),
                angles_Wcsp_to_Wcs_ixyz=euler(axes[k] @ axes[before].T) if k else np.zeros(3),
                control_surface_symmetry_type="symmetric",
                spanwise_spacing=None if last else "uniform",
            )
        )
    wing = ps.geometry.wing.Wing(
        wing_cross_sections=sections,
        Ler_Gs_Cgs=lead[0],
        angles_Gs_to_Wn_ixyz=(0.0, math.degrees(request.root_pitch - math.pi / 2), 0.0),
        symmetric=True,
        symmetryNormal_G=(0.0, 1.0, 0.0),
        symmetryPoint_G_Cg=(0.0, 0.0, 0.0),
        num_chordwise_panels=request.panels,
        chordwise_spacing="uniform",
    )
    whole = ps.geometry.airplane.Airplane(wings=[wing], s_ref=1.0, c_ref=1.0, b_ref=1.0)
    found = [whole.wings[0].panels[0, -1].Frpp_G_Cg, whole.wings[0].panels[-1, -1].Brpp_G_Cg]
    wanted = [lead[-1], lead[-1] + request.chord[-1] * axes[-1, 0]]
    if not np.allclose(found, wanted, atol=LIKE, rtol=0.0):
        raise RuntimeError(f"the corners of the lattice are at {found}, not at {wanted}; use {PACKAGE} {MAJOR}")
    return whole


def problem_of(ps: Any, request: Request) -> Any:
    """PteraSoftware's problem with the motion of ``request``, instead of one by its own oscillations."""
    n = len(request.down)
    count = request.beats * n + EXTRA

    class Prescribed(ps.problems.UnsteadyProblem):  # type: ignore[misc]
        """Airplanes of every step, as its steady problems."""

        def __init__(self) -> None:
            super(ps.problems.UnsteadyProblem, self).__init__(
                only_final_results=False,
                delta_time=1.0 / (request.frequency * n),
                num_steps=count,
                max_wake_rows=max(1, round(request.wake * n)),
                lcm_period=1.0 / request.frequency,
            )
            air = ps.operating_point.OperatingPoint(
                rho=request.density, vCg__E=request.airspeed, alpha=math.degrees(request.incidence)
            )
            foil = ps.geometry.airfoil.Airfoil(name="naca0012")  # only its straight mean line counts
            planes = [airplane(ps, request, k % n, foil) for k in range(count)]
            self._steady_problems = tuple(ps.problems.SteadyProblem([plane], air) for plane in planes)

    return Prescribed()


def solver_of(ps: Any, problem: Any) -> Any:
    """PteraSoftware's solver of ``problem`` with the wing's velocity by central differences, of second order.

    Its own are backward differences, of first order.
    """

    class Solver(ps.unsteady_ring_vortex_lattice_method.UnsteadyRingVortexLatticeMethodSolver):  # type: ignore[misc]
        late: list[Array]  # of every step, the force by the change of circulation since the step before, N

        def _finalize_loads(self) -> None:
            """Take no averages over PteraSoftware's own motion, which there is not."""

        def _load_calculation_moment_processing_hook(self, *forces: Array) -> Array:
            self.late.append(forces[-1].sum(axis=0))
            return np.zeros_like(forces[-1])

        def _gone(self, places: Callable[[int], Array]) -> Array:
            """Velocity [panels, 3] of the air past points of the wing, whose ``places`` are a function of the step."""
            early, late = max(self._current_step - 1, 0), min(self._current_step + 1, self.num_steps - 1)
            return np.asarray((places(early) - places(late)) / ((late - early) * self.delta_time))

        def _middle(self, one: str, other: str) -> Array:
            first, second = (getattr(self, f"_listStack{corner}brvp_GP1_CgP1") for corner in (one, other))
            return self._gone(lambda step: np.asarray(0.5 * (first[step] + second[step])))

        def _calculate_current_movement_velocities_at_collocation_points(self) -> Array:
            return self._gone(lambda step: np.array([panel.Cpp_GP1_CgP1 for panel in panels_of(problem, step)]))

        def _calculate_current_movement_velocities_at_right_leg_centers(self) -> Array:
            return self._middle("Br", "Fr")

        def _calculate_current_movement_velocities_at_front_leg_centers(self) -> Array:
            return self._middle("Fr", "Fl")

        def _calculate_current_movement_velocities_at_left_leg_centers(self) -> Array:
            return self._middle("Fl", "Bl")

        def _calculate_current_movement_velocities_at_back_leg_centers(self) -> Array:
            return self._middle("Bl", "Br")

    solver = Solver(problem)
    solver.late = []
    return solver


def panels_of(problem: Any, step: int) -> Any:
    """Panels of both wings at ``step`` of the ``problem``."""
    return problem.steady_problems[step].airplanes[0].wings[0].panels.ravel()


def run(ps: Any, request: Request) -> Array:
    """Forces [beats n + 1, 2] of both wings along body x and z (N) at every step of all beats, and the next step."""
    problem = problem_of(ps, request)
    solver = solver_of(ps, problem)
    solver.run(prescribed_wake=not request.free, calculate_streamlines=False, show_progress=False)
    steps = range(solver.num_steps)
    loads = np.array([sum(panel.forces_GP1 for panel in panels_of(problem, step)) for step in steps])
    late = np.array(solver.late)
    found = loads[:-2] + 0.5 * (late[1:-1] - late[:-2])  # the change of circulation by central differences, too
    return np.asarray(-found[:, [0, 2]])  # body x is forward, z down


def main() -> None:
    """Answer the request on standard input with the forces of the last beat, or end with a message and status 1.

    The reply has ``forces`` [n, 2] (N), ``settled``, the change of the force from the start of the last beat to its end
    over the RMS force, and the ``version`` of PteraSoftware.
    """
    try:
        import pterasoftware as ps

        version = importlib.metadata.version(PACKAGE)
        if version.split(".")[0] != MAJOR:
            raise RuntimeError(f"{PACKAGE} has version {version}; this script needs version {MAJOR}")
        request = Request.of(json.load(sys.stdin))
        found = run(ps, request)
        if not np.isfinite(found).all():
            raise RuntimeError("the vortex lattice gave forces that are not finite; use fewer panels or more steps")
    except Exception as error:
        sys.exit(f"{type(error).__name__}: {error}")
    last = found[-1 - len(request.down) :]
    settled = math.sqrt(((last[-1] - last[0]) ** 2).sum() / (last**2).sum(axis=1).mean())
    json.dump({"forces": last[:-1].tolist(), "settled": settled, "version": version}, sys.stdout)


if __name__ == "__main__":
    main()
