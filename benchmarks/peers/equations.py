"""The wing's equations of motion in other coordinates than the simulator's, as an independent check.

They are derived from the springs' energies and the Newton-Euler equations.

State of each body, 13 numbers: centre of mass p (m), unit quaternion q (scalar first; it rotates body axes to world
axes), velocity v (m/s) and angular velocity w (rad/s), all in **world** axes, whereas ``sim`` stores twists (linear and
angular velocity) in body axes. The code is scalar, for one individual. Equations are those of van der Grinten's thesis.

Springs (thesis Eqs. 5-7; Stramigioli). A connector joins a frame on body A, with axes a_k, and one on body B, with axes
b_k (k = 1..3); s is the vector from A's origin to B's, all in world axes. g_k are co-stiffnesses, k_k the stiffnesses
of translation, K_o the rotational stiffness matrix, and G_o = tr(K_o)/2 - K_o = diag(g_k). The energies of
``docs/peers.md`` read V_o = sum_k g_k (1 - a_k . b_k) and V_t = 1/4 s . (K_A + K_B) s with K_A = sum_k k_k a_k a_k^T,
and K_B in the same way from b_k. Their variations give

- force on B: -(K_A + K_B) s / 2; on A the opposite,
- moment on B: sum_k g_k b_k x a_k + s x (K_B s) / 2; on A: -sum_k g_k b_k x a_k + s x (K_A s) / 2.

They balance: the two moments and s x (force on B) sum to zero. Dampers (Eq. 4) oppose B's twist relative to A's frame,
at B's origin. Air: thesis Eqs. 8-13 with the changes listed in ``sim/kernels/air.py``; lift changes sign in reversed
flow as the cubic x (3 - x^2) / 2 of x = (chordwise flow) / (flow speed times sin 15 deg), limited to -1..1.

In the functions, N bodies are followed by the two driving rods: rotation matrices R [N + 2, 3, 3] (body to world axes),
positions p, velocities v and angular velocities w [N + 2, 3]. ``load`` [N + 2, 6]: force (N), then moment about the
centre of mass (N m).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy.sparse import csc_matrix

from benchmarks.peers.wing import PeerWing, rod_motion
from wingfit.sim.kernels.jit import allocating

Array = npt.NDArray[np.float64]
V3 = tuple[float, float, float]

SIZE = 13  # numbers per body
P, Q, V, W = 0, 3, 7, 10  # offsets of position, quaternion, velocity, angular velocity
_TURN = math.sin(math.radians(15.0))  # lift changes sign within 15 degrees of flow normal to the chord
_STILL = 1e-9  # m/s, keeps the angle of attack defined without flow


@allocating
def _row(x: Array, i: int) -> V3:
    return x[i, 0], x[i, 1], x[i, 2]


@allocating
def _axis(R: Array, n: int, k: int) -> V3:
    """Return axis ``k`` of body ``n`` in world axes: column k of R[n]."""
    return R[n, 0, k], R[n, 1, k], R[n, 2, k]


@allocating
def _cross(x: V3, y: V3) -> V3:
    return x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]


@allocating
def _dot(x: V3, y: V3) -> float:
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


@allocating
def _plus(x: V3, f: float, y: V3) -> V3:
    """Return the vector x + f y."""
    return x[0] + f * y[0], x[1] + f * y[1], x[2] + f * y[2]


@allocating
def _turned(R: Array, n: int, x: V3) -> V3:
    """Return R[n] x: the vector ``x``, given in axes of body ``n``, in world axes."""
    return (
        R[n, 0, 0] * x[0] + R[n, 0, 1] * x[1] + R[n, 0, 2] * x[2],
        R[n, 1, 0] * x[0] + R[n, 1, 1] * x[1] + R[n, 1, 2] * x[2],
        R[n, 2, 0] * x[0] + R[n, 2, 1] * x[1] + R[n, 2, 2] * x[2],
    )


@allocating
def _back(R: Array, n: int, x: V3) -> V3:
    """Return R[n]^T x: the vector ``x``, given in world axes, in axes of body ``n``."""
    return _dot(_axis(R, n, 0), x), _dot(_axis(R, n, 1), x), _dot(_axis(R, n, 2), x)


@allocating
def _act(load: Array, n: int, force: V3, moment: V3) -> None:
    """Add a force and a moment about the centre of mass, both in world axes, to row ``n`` of ``load`` [N + 2, 6]."""
    for i in range(3):
        load[n, i] += force[i]
        load[n, 3 + i] += moment[i]


@allocating
def rotation(w: float, x: float, y: float, z: float, R: Array) -> None:
    """Set ``R`` [3, 3] to the rotation matrix of the quaternion (w, x, y, z), which need not be a unit quaternion."""
    f = 2.0 / (w * w + x * x + y * y + z * z)
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - f * (y * y + z * z), f * (x * y - w * z), f * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = f * (x * y + w * z), 1.0 - f * (x * x + z * z), f * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = f * (x * z - w * y), f * (y * z + w * x), 1.0 - f * (x * x + y * y)


@allocating
def put_rods(wing: PeerWing, t: float, R: Array, p: Array, v: Array, w: Array) -> None:
    """Set rows N and N + 1 of R, p, v and w to the frames of the driving rods at time ``t`` (s).

    The rods rotate about x at the hinge.
    """
    n = len(wing.mass)
    for k in range(2):
        angle, rate = rod_motion(wing, t, k)
        rotation(math.cos(0.5 * angle), math.sin(0.5 * angle), 0.0, 0.0, R[n + k])
        p[n + k] = wing.hinge
        v[n + k] = 0.0
        w[n + k] = 0.0
        w[n + k, 0] = rate


@allocating
def spring_loads(wing: PeerWing, R: Array, p: Array, v: Array, w: Array, load: Array) -> None:
    """Add the forces and moments of springs and dampers on bodies and rods to ``load`` [N + 2, 6]."""
    for c in range(len(wing.first)):
        i, j = wing.first[c], wing.second[c]
        arm_a, arm_b = _turned(R, i, _row(wing.a, c)), _turned(R, j, _row(wing.b, c))
        reach = _plus(_plus(_row(p, j), -1.0, _row(p, i)), 1.0, arm_b)  # from A's centre to B's origin
        s = _plus(reach, -1.0, arm_a)
        k_a, k_b, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        # relative twist: B's origin relative to the coincident point of A's frame
        turning = _plus(_row(w, j), -1.0, _row(w, i))
        moving = _plus(_row(v, j), 1.0, _cross(_row(w, j), arm_b))
        moving = _plus(_plus(moving, -1.0, _row(v, i)), -1.0, _cross(_row(w, i), reach))
        lost_force, lost_moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        trace = wing.stiffness[c, 0] + wing.stiffness[c, 1] + wing.stiffness[c, 2]
        for k in range(3):
            a, b, stiff = _axis(R, i, k), _axis(R, j, k), wing.stiffness[c, 3 + k]
            k_a, k_b = _plus(k_a, stiff * _dot(a, s), a), _plus(k_b, stiff * _dot(b, s), b)
            moment = _plus(moment, 0.5 * trace - wing.stiffness[c, k], _cross(b, a))
            lost_moment = _plus(lost_moment, wing.damping[c, k] * _dot(a, turning), a)
            lost_force = _plus(lost_force, wing.damping[c, 3 + k] * _dot(a, moving), a)
        elastic = _plus(_plus((0.0, 0.0, 0.0), -0.5, k_a), -0.5, k_b)
        force = _plus(elastic, -1.0, lost_force)
        on_b = _plus(_plus(moment, -1.0, lost_moment), 0.5, _cross(s, k_b))
        on_a = _plus(_plus(lost_moment, -1.0, moment), 0.5, _cross(s, k_a))
        # on A: the spring's force acts at A's own origin, the damper's at B's
        on_a = _plus(_plus(on_a, -1.0, _cross(arm_a, elastic)), 1.0, _cross(reach, lost_force))
        _act(load, j, force, _plus(on_b, 1.0, _cross(arm_b, force)))
        _act(load, i, _plus((0.0, 0.0, 0.0), -1.0, force), on_a)


@allocating
def _lift_and_drag(wing: PeerWing, strip: int, chord: V3, normal: V3, flow: V3) -> tuple[V3, V3]:
    """Return lift and drag (N, world axes) of a strip (thesis Eqs. 8-11).

    ``chord``, ``normal``: unit vectors along the chord and normal to the strip; ``flow``: velocity of the air relative
    to the strip, m/s.
    """
    along, across = _dot(flow, chord), _dot(flow, normal)
    speed = math.sqrt(along * along + across * across + _STILL * _STILL)
    x = min(max(along / (_TURN * speed), -1.0), 1.0)
    side = 0.5 * x * (3.0 - x * x)
    alpha = math.atan2(across, along * side)
    pressure = 0.5 * wing.air * speed * wing.area[strip]  # the directions below contain one more factor of speed
    lift = pressure * side * (wing.coefficients[0] * alpha + wing.coefficients[1])
    drag = pressure * (wing.coefficients[2] * abs(alpha) + wing.coefficients[3])
    zero = (0.0, 0.0, 0.0)
    return (
        _plus(_plus(zero, lift * along, normal), -lift * across, chord),
        _plus(_plus(zero, drag * along, chord), drag * across, normal),
    )


@allocating
def air_loads(wing: PeerWing, R: Array, v: Array, w: Array, load: Array) -> None:
    """Add the force and the moment of the air on every body to ``load`` [N + 2, 6]."""
    for strip in range(len(wing.area)):
        flow, x, z = _row(wing.wind.reshape(1, 3), 0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        members = range(wing.strip[strip], wing.strip[strip + 1])
        for n in members:
            g = wing.weight[n]
            arm = _turned(R, n, (wing.centroid[n, 0], wing.centroid[n, 1], 0.0))
            flow = _plus(_plus(flow, -g, _row(v, n)), -g, _cross(_row(w, n), arm))
            x, z = _plus(x, g, _axis(R, n, 0)), _plus(z, g, _axis(R, n, 2))
        chord = _plus((0.0, 0.0, 0.0), 1.0 / math.sqrt(_dot(x, x)), x)
        z = _plus(z, -_dot(z, chord), chord)
        normal = _plus((0.0, 0.0, 0.0), 1.0 / math.sqrt(_dot(z, z)), z)
        lift, drag = _lift_and_drag(wing, strip, chord, normal, flow)
        for n in members:
            y = wing.centroid[n, 1]
            for force, share, place in (
                (lift, wing.lift[n, 0], wing.lift[n, 1]),
                (drag, wing.drag[n, 0], wing.drag[n, 1]),
            ):
                here = _plus((0.0, 0.0, 0.0), share, force)
                _act(load, n, here, _cross(_turned(R, n, (place, y, 0.0)), here))


@allocating
def _accelerate(wing: PeerWing, n: int, R: Array, w: V3, load: Array, dy: Array) -> None:
    """Set v' and w' (world axes) in ``dy`` [13] to the accelerations of body ``n``, by the Newton-Euler equations.

    ``w``: its angular velocity, rad/s.
    """
    spin = _back(R, n, w)
    L = _turned(R, n, _times(wing.inertia, n, spin))
    torque = _back(R, n, _plus(_row(load[:, 3:], n), -1.0, _cross(w, L)))
    turned = _turned(R, n, _solved(wing.inertia, n, torque))
    for i in range(3):
        dy[V + i] = load[n, i] / wing.mass[n]
        dy[W + i] = turned[i]
    dy[V + 2] -= wing.gravity


@allocating
def _times(A: Array, n: int, x: V3) -> V3:
    return _dot(_row(A[n], 0), x), _dot(_row(A[n], 1), x), _dot(_row(A[n], 2), x)


@allocating
def _solved(A: Array, n: int, x: V3) -> V3:
    """Return the solution y of A[n] y = x for the 3 x 3 matrix A[n], by Cramer's rule."""
    r0, r1, r2 = _axis(A, n, 0), _axis(A, n, 1), _axis(A, n, 2)
    c = _cross(r1, r2)
    f = 1.0 / _dot(r0, c)
    return f * _dot(x, c), f * _dot(x, _cross(r2, r0)), f * _dot(x, _cross(r0, r1))


@allocating
def rates(wing: PeerWing, t: float, y: Array, dy: Array) -> None:
    """Set ``dy`` [13 N] to the time derivative of the state ``y`` [13 N] at time ``t`` (s)."""
    n_bodies = len(wing.mass)
    R, p = np.empty((n_bodies + 2, 3, 3)), np.empty((n_bodies + 2, 3))
    v, w, load = np.empty((n_bodies + 2, 3)), np.empty((n_bodies + 2, 3)), np.zeros((n_bodies + 2, 6))
    for n in range(n_bodies):
        x = y[SIZE * n : SIZE * (n + 1)]
        rotation(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], R[n])
        p[n], v[n], w[n] = x[P:Q], x[V:W], x[W:]
    put_rods(wing, t, R, p, v, w)
    spring_loads(wing, R, p, v, w, load)
    if wing.air > 0.0:
        air_loads(wing, R, v, w, load)
    for n in range(n_bodies):
        x, d = y[SIZE * n : SIZE * (n + 1)], dy[SIZE * n : SIZE * (n + 1)]
        omega = _row(w, n)
        q = (x[Q + 1], x[Q + 2], x[Q + 3])
        turning = _plus(_cross(omega, q), x[Q], omega)
        d[Q] = -0.5 * _dot(omega, q)
        for i in range(3):
            d[P + i] = x[V + i]
            d[Q + 1 + i] = 0.5 * turning[i]
        _accelerate(wing, n, R, omega, load, d)


@allocating
def rates_of_rows(wing: PeerWing, t: float, rows: Array) -> Array:
    """Return the time derivatives [k, 13 N] of the k states ``rows`` [k, 13 N] at time ``t`` (s)."""
    out = np.empty_like(rows)
    for k in range(len(rows)):
        rates(wing, t, rows[k], out[k])
    return out


def right_hand_side(wing: PeerWing, t: float, y: Array) -> Array:
    """Return the time derivative of the state ``y`` at time ``t`` (s), in the form for ``scipy.integrate``.

    ``y`` is one state [13 N] or k states [13 N, k]; the result has the same shape.
    """
    if y.ndim == 1:
        return np.asarray(rates_of_rows(wing, t, y[None])[0])
    return np.asarray(rates_of_rows(wing, t, np.ascontiguousarray(y.T)).T)


def at_rest(wing: PeerWing) -> Array:
    """Return the state [13 N] of the undeformed wing at rest."""
    y = np.zeros((len(wing.mass), SIZE))
    y[:, P:Q], y[:, Q] = wing.rest, 1.0
    return y.ravel()


def sparsity(wing: PeerWing) -> csc_matrix:
    """Return the sparsity pattern [13 N, 13 N] of the Jacobian of :func:`right_hand_side`.

    Bodies joined by a connector depend on each other, and with air so do all bodies of a strip.
    """
    n = len(wing.mass)
    near = np.eye(n, dtype=bool)
    for i, j in zip(wing.first, wing.second, strict=True):
        if i < n:
            near[i, j] = near[j, i] = True
    if wing.air > 0:
        for k0, k1 in zip(wing.strip[:-1], wing.strip[1:], strict=True):
            near[k0:k1, k0:k1] = True
    forces, own = np.zeros((SIZE, SIZE), bool), np.zeros((SIZE, SIZE), bool)
    forces[V:] = True
    own[P:Q, V:W] = np.eye(3, dtype=bool)
    own[Q:V, Q:V] = own[Q:V, W:] = True
    return csc_matrix(np.kron(near, forces) | np.kron(np.eye(n, dtype=bool), own))


def marker_tracks(wing: PeerWing, states: Array) -> Array:
    """Return the world positions [T, M, 3] (m) of the M markers for ``states`` [T, 13 N] at T times."""
    x = states.reshape(len(states), -1, SIZE)[:, wing.carrier]
    p, q, u = x[..., P:Q], x[..., Q + 1 : V], x[..., Q : Q + 1]
    length = np.sum(x[..., Q:V] ** 2, axis=-1, keepdims=True)
    t = np.cross(q, np.broadcast_to(wing.markers, p.shape))
    return np.asarray(p + wing.markers + 2.0 / length * (u * t + np.cross(q, t)))
