"""The same wing in Exudyn (Gerstmayr, *Exudyn - a C++-based Python package for flexible multibody systems*, 2024).

The bodies are rigid and have Tait-Bryan angles; each connector is a six-axis spring-damper. The two driving rods are
bodies too, with their angles constrained to those of the drive. The integrator is the generalised-alpha method with a
modified Newton iteration and a sparse solver, on one thread. Needs the extra ``peers`` (pip install 'wingfit[peers]').
"""

from __future__ import annotations

import contextlib
import io
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from benchmarks.peers.equations import air_loads
from benchmarks.peers.scipy_engine import Cost, OutOfTimeError
from benchmarks.peers.wing import PeerWing, rod_motion
from wingfit.sim.kernels.jit import allocating

Array = npt.NDArray[np.float64]
Law = Literal["angles", "logarithm", "energy"]

SAMPLES = 60  # stored instants per beat
_ROD_MASS, _ROD_INERTIA = 0.1, 1e-4  # kg, kg m^2: without influence, because the rods' motion is prescribed


def load_exudyn() -> Any:
    """Import Exudyn in its fast build without range checks, and return it; ImportError if it is not installed."""
    sys.exudynFast = True  # type: ignore[attr-defined]
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # it prints a greeting
            import exudyn
    except ImportError as missing:
        raise ImportError("exudyn is not installed; install the extra: pip install 'wingfit[peers]'") from missing
    return exudyn


@dataclass(frozen=True)
class Settings:
    """Settings of Exudyn's integrator.

    Attributes:
        steps: integration steps per beat, a multiple of SAMPLES.
        law: law of the springs: "angles" (Exudyn's default, on Tait-Bryan angles), "logarithm" (Exudyn's intrinsic one,
            on the logarithm of the relative pose at mid-frame) or "energy" (wingfit's, called from Python).
        spectral_radius: spectral radius of the generalised-alpha method at infinite frequency.
        newton: relative tolerance of Newton's method.
    """

    steps: int
    law: Law = "angles"
    spectral_radius: float = 0.9
    newton: float = 1e-6

    def __post_init__(self) -> None:
        if self.steps < SAMPLES or self.steps % SAMPLES:
            raise ValueError(f"{self.steps} steps a beat is not a multiple of {SAMPLES} samples; give a multiple")


@dataclass(frozen=True)
class ExudynRun:
    """Result of a simulation from rest, with SAMPLES instants in each beat.

    Attributes:
        times: [T] s.
        tracks: [T, M, 3] positions of the markers, m.
        cpu: [beats] processor time of each beat, s.
    """

    times: Array
    tracks: Array
    cpu: Array


def simulate(wing: PeerWing, settings: Settings, *, beats: int = 2, until: float = np.inf) -> ExudynRun:
    """Integrate ``beats`` beats from rest with Exudyn.

    OutOfTimeError once ``time.monotonic()`` exceeds ``until``, ArithmeticError if Exudyn fails.
    """
    exu = load_exudyn()
    items = exu.itemInterface
    period = 2 * np.pi / wing.omega
    container = exu.SystemContainer()
    system = container.AddSystem()
    nodes, bodies = _add_bodies(items, system, wing)
    _add_connectors(items, system, wing, bodies, settings.law)
    if wing.air > 0:
        _add_air(exu, system, wing, nodes[:-2])
    marks: list[float] = []

    def watch(_: Any, t: float) -> bool:
        if not marks or t > (len(marks) + 0.5 / settings.steps) * period:  # t is the end of the next step
            marks.append(time.process_time())
        return time.monotonic() < until

    system.SetPreStepUserFunction(watch)
    wanted = exu.OutputVariableType.Coordinates
    sensors = [
        system.AddSensor(items.SensorNode(nodeNumber=n, storeInternal=True, fileName="", outputVariableType=wanted))
        for n in nodes[:-2]
    ]
    system.Assemble()
    done = system.SolveDynamic(_solver_settings(exu, settings, beats, period), showHints=False)
    marks.append(time.process_time())
    if time.monotonic() >= until:
        raise OutOfTimeError("stopped at the time limit")
    if not done:
        raise ArithmeticError(f"Exudyn gave up with {settings}")
    rows = np.array([system.GetSensorStoredData(s) for s in sensors])
    return ExudynRun(rows[0, :, 0], _marker_tracks(wing, rows[:, :, 1:]), np.diff(marks))


def _solver_settings(exu: Any, settings: Settings, beats: int, period: float) -> Any:
    chosen = exu.SimulationSettings()
    chosen.timeIntegration.endTime = beats * period
    chosen.timeIntegration.numberOfSteps = beats * settings.steps
    chosen.timeIntegration.verboseMode = 0
    chosen.timeIntegration.generalizedAlpha.spectralRadius = settings.spectral_radius
    chosen.timeIntegration.newton.useModifiedNewton = True
    chosen.timeIntegration.newton.relativeTolerance = settings.newton
    chosen.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    chosen.linearSolver.reuseAnalyzedPattern = True
    chosen.parallel.numberOfThreads = 1
    chosen.solution.file.write = False
    chosen.solution.sensors.writePeriod = period / SAMPLES
    return chosen


def _add_bodies(items: Any, system: Any, wing: PeerWing) -> tuple[list[Any], list[Any]]:
    """Add the N bodies, under gravity, and the two driving rods to ``system``.

    Returns the nodes and the objects of bodies and rods. ``items``: Exudyn's item interface.
    """
    nodes, bodies = [], []
    for mass, inertia, place in zip(wing.mass, wing.inertia, wing.rest, strict=True):
        J = [inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[1, 2], inertia[0, 2], inertia[0, 1]]
        node, body = _add_body(items, system, float(mass), J, place)
        centre = system.AddMarker(items.MarkerBodyMass(bodyNumber=body))
        system.AddLoad(items.LoadMassProportional(markerNumber=centre, loadVector=[0, 0, -wing.gravity]))
        nodes.append(node)
        bodies.append(body)
    ground = system.AddNode(items.NodePointGround())
    fixed = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=ground, coordinate=0))
    for rod in range(2):
        node, body = _add_body(items, system, _ROD_MASS, [_ROD_INERTIA] * 3 + [0.0] * 3, wing.hinge)
        for axis in range(6):
            held = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=axis))
            drive = {"offsetUserFunction": _drive(wing, rod, 0), "offsetUserFunction_t": _drive(wing, rod, 1)}
            options = drive if axis == 3 else {}
            system.AddObject(items.ObjectConnectorCoordinate(markerNumbers=[fixed, held], **options))
        nodes.append(node)
        bodies.append(body)
    return nodes, bodies


def _add_body(items: Any, system: Any, mass: float, inertia: list[float], place: Array) -> tuple[Any, Any]:
    node = system.AddNode(items.NodeRigidBodyRxyz(referenceCoordinates=[*place, 0.0, 0.0, 0.0]))
    body = system.AddObject(items.ObjectRigidBody(nodeNumber=node, mass=mass, inertia=inertia))
    return node, body


def _drive(wing: PeerWing, rod: int, derivative: int) -> Callable[[Any, float, int, float], float]:
    def offset(_: Any, t: float, __: int, ___: float) -> float:
        return float(rod_motion(wing, t, rod)[derivative])

    return offset


def _add_connectors(items: Any, system: Any, wing: PeerWing, bodies: list[Any], law: Law) -> None:
    """Add the springs and dampers between ``bodies`` to ``system``.

    In Exudyn's matrices translation comes before rotation, in ``wing`` after it.
    """
    order = [3, 4, 5, 0, 1, 2]
    for c, (i, j) in enumerate(zip(wing.first, wing.second, strict=True)):
        ends = [
            system.AddMarker(items.MarkerBodyRigid(bodyNumber=bodies[n], localPosition=place))
            for n, place in ((i, wing.a[c]), (j, wing.b[c]))
        ]
        options: dict[str, Any] = {"useIntrinsicFormulation": law == "logarithm"}
        if law == "energy":
            options = {"springForceTorqueUserFunction": _energy_law(wing.stiffness[c], wing.damping[c])}
        system.AddObject(
            items.ObjectConnectorRigidBodySpringDamper(
                markerNumbers=ends,
                stiffness=np.diag(wing.stiffness[c, order]),
                damping=np.diag(wing.damping[c, order]),
                **options,
            )
        )


@allocating
def tait_bryan(a: float, b: float, c: float, R: Array) -> None:
    """Set ``R`` [3, 3] to the rotation matrix R_x(a) R_y(b) R_z(c) of the Tait-Bryan angles a, b, c (rad)."""
    sa, ca, sb, cb, sc, cc = np.sin(a), np.cos(a), np.sin(b), np.cos(b), np.sin(c), np.cos(c)
    R[0, 0], R[0, 1], R[0, 2] = cb * cc, -cb * sc, sb
    R[1, 0], R[1, 1], R[1, 2] = ca * sc + sa * sb * cc, ca * cc - sa * sb * sc, -sa * cb
    R[2, 0], R[2, 1], R[2, 2] = sa * sc - ca * sb * cc, sa * cc + ca * sb * sc, ca * cb


@allocating
def energy_wrench(K: Array, D: Array, d: Array, angles: Array, v: Array, w: Array) -> Array:
    """Return the force and the moment [6] on the first body of one connector, by the energies of ``docs/peers.md``.

    All in the first body's axes. ``K``, ``D`` [6]: stiffness and damping, rotation before translation; ``d``: vector
    between the connector's ends (m); ``angles``: Tait-Bryan angles of the relative rotation Q (rad); ``v``, ``w``:
    relative velocity (m/s) and angular velocity (rad/s).

    With the translational stiffness K_t and co-stiffnesses g_k, the force is (K_t + Q K_t Q^T) d / 2, and the moment on
    the second body is sum_k g_k (Q e_k) x e_k + d x (Q K_t Q^T d) / 2; dampers are added. Exudyn takes the moment on
    the first body to be the opposite of that on the second, though the forces act d apart; see ``docs/peers.md``.
    """
    Q, out = np.empty((3, 3)), np.empty(6)
    tait_bryan(angles[0], angles[1], angles[2], Q)
    half = np.zeros(3)  # Q K_t Q^T d / 2
    for k in range(3):
        half += 0.5 * K[3 + k] * (Q[0, k] * d[0] + Q[1, k] * d[1] + Q[2, k] * d[2]) * Q[:, k]
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        g_i, g_j = 0.5 * (K[k] + K[j] - K[i]), 0.5 * (K[k] + K[i] - K[j])
        moment = g_j * Q[i, j] - g_i * Q[j, i] + d[i] * half[j] - d[j] * half[i]
        out[k] = 0.5 * K[3 + k] * d[k] + half[k] + D[3 + k] * v[k]
        out[3 + k] = D[k] * w[k] - moment
    return out


def _energy_law(K: Array, D: Array) -> Callable[..., Array]:
    def wrench(_: Any, __: float, ___: int, d: Any, angles: Any, v: Any, w: Any, *____: Any) -> Array:
        return np.asarray(energy_wrench(K, D, np.asarray(d), np.asarray(angles), np.asarray(v), np.asarray(w)))

    return wrench


@allocating
def air_on_angles(wing: PeerWing, q: Array, q_t: Array) -> Array:
    """Return the generalised force [6 N] of the air on the N bodies.

    ``q`` [6 N]: displacement (m) and Tait-Bryan angles (rad) of each body; ``q_t`` [6 N]: their time derivatives. With
    angles a, b, c and R = R_x R_y R_z the angular velocity is w = e_x a' + (R_x e_y) b' + (R_x R_y e_z) c'; hence the
    generalised force of a moment M is M . e_x for a, M . (R_x e_y) for b, and M . (R_x R_y e_z) for c.
    """
    n_bodies = len(wing.mass)
    R, axes = np.empty((n_bodies, 3, 3)), np.zeros((n_bodies, 3, 3))
    v, w, load = np.empty((n_bodies, 3)), np.zeros((n_bodies, 3)), np.zeros((n_bodies, 6))
    for n in range(n_bodies):
        a, b, c = q[6 * n + 3], q[6 * n + 4], q[6 * n + 5]
        tait_bryan(a, b, c, R[n])
        axes[n, 0, 0] = 1.0
        axes[n, 1, 1], axes[n, 1, 2] = np.cos(a), np.sin(a)
        axes[n, 2] = R[n, :, 2]
        v[n] = q_t[6 * n : 6 * n + 3]
        for k in range(3):
            w[n] += axes[n, k] * q_t[6 * n + 3 + k]
    air_loads(wing, R, v, w, load)
    out = np.empty(6 * n_bodies)
    for n in range(n_bodies):
        for k in range(3):
            out[6 * n + k] = load[n, k]
            out[6 * n + 3 + k] = np.sum(axes[n, k] * load[n, 3:])
    return out


def _add_air(exu: Any, system: Any, wing: PeerWing, nodes: list[Any]) -> None:
    """Add the force of the air to ``system`` as one object on all ``nodes``, evaluated at every Newton iteration.

    Its Jacobian is omitted: the air is soft compared with the springs, and Newton's method converges without it.
    """
    size = 6 * len(nodes)
    nothing = exu.MatrixContainer()
    nothing.SetWithSparseMatrix(np.zeros((0, 3)), size, size)

    def force(_: Any, __: float, ___: int, q: Any, q_t: Any) -> Array:
        return np.asarray(air_on_angles(wing, np.asarray(q), np.asarray(q_t)))

    system.AddObject(
        exu.itemInterface.ObjectGenericODE2(
            nodeNumbers=nodes,
            massMatrix=nothing,
            forceUserFunction=force,
            jacobianUserFunction=lambda *_: nothing,
        )
    )


def _marker_tracks(wing: PeerWing, q: Array) -> Array:
    """Return the world positions [T, M, 3] (m) of the M markers at T times.

    ``q`` [N, T, 6]: displacement (m) and Tait-Bryan angles (rad) of each of N bodies.
    """
    x = q[wing.carrier]
    R = Rotation.from_euler("XYZ", x[..., 3:].reshape(-1, 3)).as_matrix().reshape(*x.shape[:2], 3, 3)
    there = wing.rest[wing.carrier][:, None] + x[..., :3] + np.einsum("mtij,mj->mti", R, wing.markers)
    return np.asarray(np.swapaxes(there, 0, 1))


def cheapest(
    wing: PeerWing,
    tolerance_mm: float,
    *,
    law: Law = "angles",
    steps: Sequence[int] = (60, 120, 180, 240, 300, 360, 480, 600, 720, 960, 1440, 1920),
    newtons: Sequence[float] = (1e-3, 1e-4),
    converged: int = 3840,
    seconds: float = 600.0,
) -> Cost:
    """Measure the beat after the start-up ramp with the fewest steps that keep markers within ``tolerance_mm``.

    The error is measured against the run with ``converged`` steps a beat and the same spring law. ``steps``: numbers of
    steps a beat to try in turn; ``newtons``: tolerances of Newton's method, of which the cheapest one that suffices is
    used; ``seconds``: time limit for everything. Without a result, the returned Cost gives the reason.
    """
    until = time.monotonic() + seconds
    method, note = f"generalised alpha, {law}", f"not found within {seconds:g} s; allow more time"
    try:
        fine = simulate(wing, Settings(converged, law, newton=1e-8), until=until).tracks
        for count in steps:
            found = [_cost(wing, Settings(count, law, newton=newton), fine, until) for newton in newtons]
            good = [cost for cost in found if cost.error_mm is not None and cost.error_mm <= tolerance_mm]
            if good:
                return replace(min(good, key=lambda cost: cost.cpu_ms_per_beat or np.inf), method=method)
        note = f"no step down to 1/{steps[-1]} beat suffices"
    except OutOfTimeError:
        pass
    return Cost(None, None, method, {}, note)


def _cost(wing: PeerWing, settings: Settings, fine: Array, until: float) -> Cost:
    used = {"steps_per_beat": float(settings.steps), "newton": settings.newton, "rho": settings.spectral_radius}
    try:
        run = simulate(wing, settings, until=until)
    except ArithmeticError as gave_up:
        return Cost(None, None, "", used, str(gave_up))
    error = 1e3 * float(np.linalg.norm((run.tracks - fine)[-SAMPLES:], axis=-1).max())
    return Cost(1e3 * float(run.cpu[-1]), error, "", used)
