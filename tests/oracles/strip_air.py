"""Air loads on the bodies of a wing, written from the text of van der Grinten's thesis, Eqs. 8-13."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class Blown(NamedTuple):
    """Input of the air kernel, with the shapes of its docstring."""

    start: npt.NDArray[np.int64]
    weight: Array
    centroid: Array
    area: Array
    density: float
    wind: Array
    coefficients: Array
    lift_share: Array
    lift_x: Array
    drag_share: Array
    drag_x: Array
    R: Array
    V: Array


def strip_air(case: Blown, s: int, w: int) -> tuple[Array, Array, Array]:
    """Unit chord, unit normal and flow past strip ``s`` in lane ``w``, in the world."""
    members = range(case.start[s], case.start[s + 1])
    chord, normal, motion = np.zeros(3), np.zeros(3), np.zeros(3)
    for n in members:
        R, arm = case.R[n, :, w].reshape(3, 3), np.array([*case.centroid[n], 0.0])
        chord += case.weight[n] * R[:, 0]
        normal += case.weight[n] * R[:, 2]
        motion += case.weight[n] * R @ (case.V[n, 3:, w] + np.cross(case.V[n, :3, w], arm))
    chord /= np.linalg.norm(chord)
    spanwise = np.cross(normal, chord)
    spanwise /= np.linalg.norm(spanwise)
    return chord, np.cross(chord, spanwise), case.wind - motion


def strip_loads(case: Blown, s: int, w: int) -> tuple[Array, Array]:
    """Lift and drag of strip ``s`` in lane ``w``, in the world: Eqs. 8-11 in the plane across the span."""
    chord, normal, flow = strip_air(case, s, w)
    along, across = flow @ chord, flow @ normal
    speed = np.hypot(along, across)
    x = np.clip(along / (np.sin(np.radians(15.0)) * speed), -1, 1)
    forward = x * (3 - x**2) / 2  # -1 where the flow comes from behind
    alpha = np.arctan2(across, along * forward)
    L_a, L_b, ID_a, ID_b = case.coefficients[:, w]
    dynamic = 0.5 * case.density * speed**2 * case.area[s]
    downstream = (along * chord + across * normal) / speed
    upward = (along * normal - across * chord) / speed * forward
    return dynamic * (L_a * alpha + L_b) * upward, dynamic * (ID_a * abs(alpha) + ID_b) * downstream


def body_loads(case: Blown) -> tuple[Array, Array]:
    """Wrenches [N, 6, W] on the bodies and force [3, W] in the world."""
    lanes = case.V.shape[-1]
    wrench, force = np.zeros((len(case.weight), 6, lanes)), np.zeros((3, lanes))
    for w in range(lanes):
        for s in range(len(case.area)):
            lift, drag = strip_loads(case, s, w)
            force[:, w] += lift + drag
            for n in range(case.start[s], case.start[s + 1]):
                R = case.R[n, :, w].reshape(3, 3)
                for load, share, x in ((lift, case.lift_share, case.lift_x), (drag, case.drag_share, case.drag_x)):
                    here = share[n, w] * R.T @ load
                    wrench[n, :3, w] += np.cross([x[n, w], case.centroid[n, 1], 0.0], here)
                    wrench[n, 3:, w] += here
    return wrench, force
