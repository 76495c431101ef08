"""Bundle adjustment: least squares of pixels over cameras and over the poses of rigid bodies that they see.

A body is a chessboard in one view, or a wand in one frame: it has known points, and an unknown pose. Levenberg's and
Marquardt's method (1963) is used with the poses of the bodies eliminated (Schur complement; Triggs et al. 2000,
"Bundle adjustment - a modern synthesis", section 6.1). ``scipy.optimize.least_squares`` was not used: its steps for a
sparse Jacobian are iterative, and slow where focal length, distance and distortion are correlated; a dense Jacobian
has too many columns for hundreds of frames.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse
from scipy.spatial.transform import Rotation

from wingfit.cameras.camera import Camera, Lens
from wingfit.records.array_types import Array, Bool, Float, Index, Int, Mask

BODY_MOTIONS = 6  # turns about the axes of the body, then moves along those of the space
MAX_STEPS = 100
CONVERGED = 1e-12  # relative decrease of the sum of squares in one step
FIRST_DAMPING, LEAST_DAMPING, LARGEST_DAMPING = 1e-4, 1e-12, 1e10


@dataclass(frozen=True, eq=False)
class Observations:
    """Pixels of known points of bodies: the numbers of the ``camera``, ``body`` and ``point``, and ``pixels``."""

    camera: Int[Index, " N"]
    body: Int[Index, " N"]
    point: Int[Index, " N"]
    pixels: Float[Array, "N 2"]

    def only(self, chosen: Bool[Mask, " N"]) -> Observations:
        """Return the observations that are ``chosen``."""
        return Observations(self.camera[chosen], self.body[chosen], self.point[chosen], self.pixels[chosen])


@dataclass(frozen=True, eq=False)
class Scene:
    """Cameras, the points of the bodies in their own axes ``shape`` (m), and the pose of each body in space.

    A point of the body is at ``rotations @ point + translations`` (m) in space.
    """

    cameras: tuple[Camera, ...]
    shape: Float[Array, "K 3"]
    rotations: Float[Array, "B 3 3"]
    translations: Float[Array, "B 3"]

    def points(self, body: Int[Index, " N"], point: Int[Index, " N"]) -> Float[Array, "N 3"]:
        """Return the places in space (m) of the points numbered ``point`` of the bodies numbered ``body``."""
        return np.asarray(np.einsum("nij,nj->ni", self.rotations[body], self.shape[point]) + self.translations[body])


@dataclass(frozen=True, eq=False)
class Free:
    """What is estimated: ``parameters`` of all cameras, in their order, and ``motions`` of each body."""

    parameters: Bool[Mask, " P"]
    motions: Bool[Mask, "B 6"]


@dataclass(frozen=True, eq=False)
class Adjusted:
    """The result: the ``scene``, ``errors`` (pixels predicted less those observed), and the ``information``.

    ``information`` is the normal matrix of the parameters of the cameras after elimination of the bodies, in 1/px^2
    times the units of the parameters; rows and columns of parameters that are held are those of the unit matrix.
    """

    scene: Scene
    errors: Float[Array, "N 2"]
    information: Float[Array, "P P"]
    steps: int


def projection_errors(scene: Scene, seen: Observations) -> Float[Array, "N 2"]:
    """Return the pixels that ``scene`` predicts less those observed."""
    errors = np.empty_like(seen.pixels)
    for number, camera in enumerate(scene.cameras):
        rows = seen.camera == number
        errors[rows] = camera.project(scene.points(seen.body[rows], seen.point[rows])) - seen.pixels[rows]
    return errors


def adjust(
    scene: Scene, seen: Observations, free: Free, huber_px: float | None = None, tolerance: float = CONVERGED
) -> Adjusted:
    """Minimise the squared errors of ``seen`` over what is ``free``, from the start ``scene``.

    With ``huber_px``, an error beyond it counts linearly (Huber 1964). Every body with free motions must be seen. The
    last step decreases the sum by less than ``tolerance`` times its value.
    """
    system = _linearise(scene, seen, free, huber_px)
    damping, steps = FIRST_DAMPING, 0
    while steps < MAX_STEPS and damping < LARGEST_DAMPING:
        steps += 1
        trial = _moved(scene, *system.step(damping))
        cost = _cost(projection_errors(trial, seen), huber_px)
        if not cost <= system.cost:
            damping *= 10
            continue
        decrease = system.cost - cost
        scene, damping = trial, max(damping / 10, LEAST_DAMPING)
        system = _linearise(scene, seen, free, huber_px)
        if decrease <= tolerance * cost:
            break
    return Adjusted(scene, system.errors, system.information(), steps)


@dataclass(frozen=True, eq=False)
class _System:
    """Normal equations: of cameras ``a`` [P, P], of bodies ``b`` [B, 6, 6], both ``ab`` [B, P, 6], and gradients."""

    a: Array
    b: Array
    ab: Array
    gradient_a: Array
    gradient_b: Array
    free: Free
    errors: Array
    cost: float

    def step(self, damping: float) -> tuple[Array, Array]:
        """Return the damped step of the cameras [P] and that of the bodies [B, 6]."""
        a = self.a + damping * np.diag(np.diag(self.a))
        diagonal = np.einsum("bii->bi", self.b)
        b = self.b + damping * diagonal[:, :, None] * np.eye(BODY_MOTIONS)
        to_b = np.linalg.solve(b, np.concatenate([self.ab.transpose(0, 2, 1), self.gradient_b[:, :, None]], axis=2))
        reduced = a - np.einsum("bpi,biq->pq", self.ab, to_b[:, :, :-1])
        right = self.gradient_a - np.einsum("bpi,bi->p", self.ab, to_b[:, :, -1])
        scale = 1 / np.sqrt(np.diag(a))
        cameras = -scale * np.linalg.lstsq(reduced * np.outer(scale, scale), scale * right, rcond=None)[0]
        cameras = np.where(self.free.parameters, cameras, 0.0)
        return cameras, -to_b[:, :, -1] - np.einsum("bip,p->bi", to_b[:, :, :-1], cameras)

    def information(self) -> Array:
        """Return the normal matrix [P, P] of the cameras after elimination of the bodies."""
        return np.asarray(
            self.a - np.einsum("bpi,biq->pq", self.ab, np.linalg.solve(self.b, self.ab.transpose(0, 2, 1)))
        )


def _linearise(scene: Scene, seen: Observations, free: Free, huber_px: float | None) -> _System:
    starts = parameter_starts(scene.cameras)
    count, bodies = starts[-1], len(scene.rotations)
    a, ab, b = np.zeros((count, count)), np.zeros((bodies, count, 6)), np.zeros((bodies, 6, 6))
    gradient_a, gradient_b = np.zeros(count), np.zeros((bodies, 6))
    errors = np.empty_like(seen.pixels)
    for number, camera in enumerate(scene.cameras):
        rows, columns = seen.camera == number, slice(starts[number], starts[number + 1])
        body = seen.body[rows]
        pixels, by_camera, by_body = _derivatives(camera, scene, body, seen.point[rows])
        errors[rows] = pixels - seen.pixels[rows]
        by_camera, by_body = by_camera * free.parameters[columns], by_body * free.motions[body][:, None, :]
        weighted = _weights(errors[rows], huber_px)[:, None, None] * by_camera
        flat = by_camera.reshape(-1, by_camera.shape[2])
        a[columns, columns] = weighted.reshape(flat.shape).T @ flat
        gradient_a[columns] = weighted.reshape(flat.shape).T @ errors[rows].ravel()
        ab[:, columns] = _summed(np.einsum("nci,ncj->nij", weighted, by_body), body, bodies)
        weighted = _weights(errors[rows], huber_px)[:, None, None] * by_body
        b += _summed(np.einsum("nci,ncj->nij", weighted, by_body), body, bodies)
        gradient_b += _summed(np.einsum("nci,nc->ni", weighted, errors[rows]), body, bodies)
    a[~free.parameters, ~free.parameters] = 1.0
    held, axis = np.nonzero(~free.motions)
    b[held, axis, axis] = 1.0
    return _System(a, b, ab, gradient_a, gradient_b, free, errors, _cost(errors, huber_px))


def _summed(values: Array, body: Index, bodies: int) -> Array:
    """Return the sums of ``values`` [N, ...] over the observations of each body."""
    count = len(values)
    chosen = scipy.sparse.csr_array((np.ones(count), (body, np.arange(count))), shape=(bodies, count))
    return np.asarray(chosen @ values.reshape(count, -1)).reshape(bodies, *values.shape[1:])


def _derivatives(camera: Camera, scene: Scene, body: Index, point: Index) -> tuple[Array, Array, Array]:
    """Return pixels [N, 2], their derivatives by the camera [N, 2, P] and by motions of the body [N, 2, 6]."""
    pixels, by_point, by_camera = camera.project_with_changes(scene.points(body, point))
    # A small turn w about the axes of the body moves a point s of it by R (w x s).
    turned = -np.einsum("ncd,nde,nef->ncf", by_point, scene.rotations[body], cross_matrices(scene.shape[point]))
    return pixels, by_camera, np.concatenate([turned, by_point], axis=2)


def cross_matrices(vectors: Float[Array, "N 3"]) -> Float[Array, "N 3 3"]:
    """Return the matrices that form the cross product of each of ``vectors`` with another vector."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)


def parameter_starts(cameras: tuple[Camera, ...]) -> list[int]:
    """Return where the parameters of each camera start in those of all, and as last entry their number."""
    return [0, *np.cumsum([len(camera.parameter_names) for camera in cameras]).tolist()]


def moved_camera(camera: Camera, change: Float[Array, " P"]) -> Camera:
    """Return ``camera`` with ``change`` added to its parameters, as ``Camera.project_with_changes`` defines them."""
    lens = len(camera.lens.coefficients)
    focal_and_centre, coefficients, turn, move = np.split(change, [4, 4 + lens, 7 + lens])
    matrix = camera.matrix.copy()
    matrix[[0, 1, 0, 1], [0, 1, 2, 2]] += focal_and_centre
    values = tuple((np.array(camera.lens.coefficients) + coefficients).tolist())
    rotation = np.asarray(Rotation.from_rotvec(turn).as_matrix() @ camera.rotation)
    return replace(
        camera,
        matrix=matrix,
        lens=Lens(camera.lens.model, values),
        rotation=rotation,
        translation=camera.translation + move,
    )


def _moved(scene: Scene, cameras: Array, bodies: Array) -> Scene:
    starts = parameter_starts(scene.cameras)
    changed = [moved_camera(one, cameras[starts[i] : starts[i + 1]]) for i, one in enumerate(scene.cameras)]
    rotations = scene.rotations @ Rotation.from_rotvec(bodies[:, :3]).as_matrix()
    return Scene(tuple(changed), scene.shape, rotations, scene.translations + bodies[:, 3:])


def _weights(errors: Array, huber_px: float | None) -> Array:
    if huber_px is None:
        return np.ones(len(errors))
    return np.asarray(huber_px / np.maximum(np.linalg.norm(errors, axis=1), huber_px))


def _cost(errors: Array, huber_px: float | None) -> float:
    squares = np.sum(errors**2, axis=1)
    if huber_px is not None:
        squares = np.where(squares > huber_px**2, 2 * huber_px * np.sqrt(squares) - huber_px**2, squares)
    return float(np.sum(squares))
