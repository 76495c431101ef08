"""A beam approximated by a chain of rigid bodies (a foam wing of the simulator), under a large load at its tip."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from benchmarks.physics.beam_theory import Beam
from benchmarks.physics.plates import loaded, plate, spring_wrenches
from wingfit.records import Materials, Rod, Station
from wingfit.sim.kernels import LANES
from wingfit.sim.solver.scene import at_rest
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.structure import Structure, build

Array = npt.NDArray[np.float64]


def cut_beam(beam: Beam, division: str) -> Structure:
    """Divide the beam into rigid bodies: a foam wing with a straight centre line, and rods without stiffness or mass.

    ``division``: discretisation, such as "8x2": 8 strips along the span, 2 bodies along the chord.
    """
    middle, (c0, c1), (h0, h1) = beam.chord[0] / 2, beam.chord, beam.thickness
    rods = tuple(Rod(n, middle, 0.0, middle, beam.length, 0.0, 0.0, 0.0) for n in ("front", "rear"))
    stations = tuple(Station(y, middle - c / 2, c, h) for y, c, h in ((0.0, c0, h0), (beam.length, c1, h1)))
    wing = plate(c0, beam.length, h0, (rods[0], rods[1]))
    wing = replace(wing, stations=stations, materials=Materials(beam.density, 0.0))
    return build(wing, Division.parse(division))


def genome(beam: Beam) -> dict[str, float]:
    """Return gene values of a wing, by name: the moduli of the beam, and no damping."""
    return {"E_f": beam.young, "G_f": beam.shear, "D_E": 0.0, "D_G": 0.0}


class _Chain:
    """Chain of n rigid bodies on their springs under a constant force at the tip, in joint coordinates.

    The joint coordinates u [n, 6] are the rotation vector (rad) of each joint, and its displacement (m) in axes of the
    body on the side of the root. (In coordinates of the bodies themselves every rotation stretches the stiff chain, and
    Newton's method converges slowly.)
    """

    def __init__(self, beam: Beam, strips: int) -> None:
        self.structure = cut_beam(beam, f"{strips}x1")
        self.springs = loaded(self.structure, genome(beam)).stiffness
        self.n, self.state = strips, at_rest(self.structure)
        self.tip = np.array([0.0, beam.length - self.state.p[strips - 1, 1, 0], 0.0])
        w = self.structure.wiring
        # arms of the joint on the root side of each body; the first joint is on the first rod (the second coincides)
        inner = np.array([np.flatnonzero(w.second == k)[0] for k in range(strips)])
        self.a, self.b = w.a[inner], w.b[inner]

    def poses(self, u: Array) -> tuple[Array, Array]:
        """Return rotation matrices [W, n + 2, 3, 3] and positions [W, n + 2, 3] (m) of bodies and rods.

        ``u`` [W, 6 n]: W sets of joint coordinates.
        """
        joint = u.reshape(len(u), self.n, 6)
        R = np.tile(self.state.R[..., 0].reshape(-1, 3, 3), (len(u), 1, 1, 1))
        p = np.tile(self.state.p[..., 0], (len(u), 1, 1))
        for k in range(self.n):
            inner = k - 1 if k else self.n
            point = p[:, inner] + np.einsum("wij,wj->wi", R[:, inner], self.a[k] + joint[:, k, 3:])
            R[:, k] = R[:, inner] @ Rotation.from_rotvec(joint[:, k, :3]).as_matrix()
            p[:, k] = point - R[:, k] @ self.b[k]
        return R, p

    def unbalanced(self, u: Array, load: float) -> Array:
        """Return the sums of moments (N m) and forces (N) [W, 6 n] on the bodies, in body axes.

        ``u`` [W, 6 n]: W sets of joint coordinates; ``load``: tip force, N. The sums vanish in equilibrium.
        """
        found = []
        R_all, p_all = self.poses(u[np.arange(-(-len(u) // LANES) * LANES) % len(u)])
        for k in range(0, len(u), LANES):
            R = np.ascontiguousarray(np.moveaxis(R_all[k : k + LANES], 0, -1)).reshape(self.n + 2, 9, LANES)
            p = np.ascontiguousarray(np.moveaxis(p_all[k : k + LANES], 0, -1))
            wrench = spring_wrenches(self.structure, self.springs, R, p)
            found.append(np.moveaxis(wrench[: self.n], -1, 0).reshape(LANES, -1))
        rest = np.concatenate(found)[: len(u)]
        force = R_all[: len(u), self.n - 1, 2] * load  # upward in the world, in axes of the last body
        rest[:, -6:] += np.concatenate([np.cross(self.tip, force), force], axis=1)
        return rest

    def settle(self, load: float) -> tuple[Array, Array]:
        """Compute the equilibrium under the tip force ``load`` (N) by Newton's method.

        Returns rotation matrices [n + 2, 3, 3] and positions [n + 2, 3] (m) of bodies and rods.
        """
        size, h, u = 6 * self.n, 1e-5, np.zeros(6 * self.n)
        for _ in range(40):
            sides = self.unbalanced(u + h * np.concatenate([np.eye(size), -np.eye(size)]), load)
            slope = (sides[:size] - sides[size:]).T / (2 * h)
            step = -np.linalg.solve(slope, self.unbalanced(u[None], load)[0])
            u = u + step * min(1.0, 0.3 / float(np.abs(step).max()))
            if np.abs(step).max() < 1e-9:
                R, p = self.poses(u[None])
                return R[0], p[0]
        raise RuntimeError(f"no equilibrium of {self.n} strips under {load:g} N after 40 Newton steps")


def spring_chain(beam: Beam, strips: int, load: float) -> tuple[float, float, float]:
    """Return deflection / L, shortening / L and tip rotation (rad) of a uniform beam's chain of ``strips`` bodies.

    ``load`` is P L^2 / (E I), with tip force P and length L, as in :func:`beam_theory.elastica`, the exact solution.
    """
    chain = _Chain(beam, strips)
    inertia = beam.chord[0] * beam.thickness[0] ** 3 / 12
    R, p = chain.settle(load * beam.young * inertia / beam.length**2)
    last = R[strips - 1]
    tip = p[strips - 1] + last @ chain.tip
    return float(tip[2] / beam.length), float(1 - tip[1] / beam.length), math.atan2(last[2, 1], last[1, 1])
