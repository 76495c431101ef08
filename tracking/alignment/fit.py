"""Least-squares fit of the wing's frame, its states in each frame of the recording, and the rest positions.

The measured position p of a marker is related to the wing's hinge coordinates by y = F (p - o), with an orthogonal
matrix F, det F = 1 for a right wing and -1 for a left one, and the camera position o of the hinge. Gauss-Newton steps
with Cauchy weights; states of single frames are eliminated (Schur complement), so that the cost grows linearly with the
frames. The rest positions have the described ones as a prior, whose standard deviation is estimated with them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from wingfit.records.array_types import Array, Mask
from wingfit.records.blas_threads import one_blas_thread
from wingfit.tracking.alignment.pose_error import Frames, PoseError
from wingfit.tracking.alignment.shake import jitter_costs, jitter_precision, shake_of
from wingfit.tracking.alignment.wing_model import BENDING, STATES, SWEEPING, TWISTING, Strip, positions

# Prior standard deviations of the states, rad: none for the flap angle; bending, twist and sweep are hardly restricted.
_STATE_PRIOR = np.array([1e3] + [0.35] * BENDING + [0.45] * TWISTING + [0.025] * SWEEPING)
# Of their means over the beat: mean loads bend and twist a wing as they do a cantilever, whose slope is
# c (s - s^2 + s^3 / 3); what bends it at rest is in the rest positions.
_CANTILEVER = np.array([1.0, -1.0, 1.0 / 3.0])
_MEAN_LOADS = np.radians([1.6, 3.0])  # standard deviations of c: bending, twist
_MEAN_OTHER = np.radians([0.3] * BENDING + [0.8] * TWISTING + [0.12] * SWEEPING)
_ELASTIC = slice(1, STATES)
_MEANS = STATES - 1


def _mean_prior() -> Array:
    """Covariance [_MEANS, _MEANS] of the means of the elastic states, rad^2."""
    found = np.diag(_MEAN_OTHER**2)
    for first, deviation in zip((0, BENDING), _MEAN_LOADS, strict=True):
        part = slice(first, first + len(_CANTILEVER))
        found[part, part] += deviation**2 * np.outer(_CANTILEVER, _CANTILEVER)
    return found


_MEAN_PRIOR = _mean_prior()
_MEAN_PRECISION = np.linalg.inv(_MEAN_PRIOR)
_JITTER = 5
_LOCAL = STATES + _JITTER
_SLOW_TURN, _SLOW_SHIFT = np.radians(2.0), 0.02  # standard deviations of the remainder of slow motion: rad, spans
_LINE_PRIOR = 0.15  # standard deviation of the line that a wing twists about, chords
_FRAME = 7  # small rotation about y and z, a shift, and the line: rotation about x is the zero of phi
_STEPS = 40
_STATE_STEPS = 10
_SETTLED = 3e-5  # change of the pose in radians and in spans at which the iteration ends
_SETTLED_SCATTER = 0.02  # change of the scatter, of itself
_FIRST_SCATTER = 5e-3
_LEAST_REST, _MOST_REST = 2e-4, 1e-2  # standard deviation of described rest positions, spans
_CAUCHY = 3.0
_LEAST_CORRELATION = 0.6  # of consecutive residuals: where noise is white, the errors of the model are not
_LEAST_NOISE = 1e-5  # spans


@dataclass(frozen=True, eq=False)
class Fit:
    """A wing's frame with everything that was estimated with it.

    Attributes:
        turn: [3, 3] F, from camera axes to wing axes; its determinant is 1 for a right wing, -1 for a left one.
        hinge: [3] o, camera position of the hinge, m.
        states: [T, STATES] as in :mod:`.wing_model`, rad.
        jitter: [T, 5] motion of the body in each frame that was not removed: rotation about y and z (rad), shift (m).
        drift: [D, 5] the same of slow motion, as coefficients of D polynomials over time.
        line: [2] that the wing twists about, as in :mod:`.wing_model`, m.
        rest: [M, 3] rest positions in hinge coordinates, m.
        noise: standard deviation of one coordinate of one sample, model errors included, m.
        scatter: standard deviation of the described rest positions, m.
        memory: number of consecutive samples that count as one, because noise and model errors are correlated in time.
        shake: standard deviation of each coordinate of the part of the jitter that all tracks share anew in each frame,
            as of cameras that shake, m.
        cost: minus twice the log-likelihood (up to a constant of the tracks), with robust weights.
        flap_error: standard error of the mean flap angle, rad.
        covariance: [7 + 3 M, 7 + 3 M] of the rotation about y and z (rad), the shift, line and rest positions (m).
        residuals: [T, M, 3] measured minus modelled position in wing axes, m; NaN where not seen.
        jitter_costs: [T] minus twice the log-likelihood of each frame's jitter.
    """

    turn: Array
    hinge: Array
    states: Array
    jitter: Array
    drift: Array
    line: Array
    rest: Array
    noise: float
    scatter: float
    memory: float
    shake: float
    cost: float
    flap_error: float
    covariance: Array
    residuals: Array
    jitter_costs: Array

    @property
    def right(self) -> bool:
        """Whether it is a right wing."""
        return float(np.linalg.det(self.turn)) > 0

    def coordinates(self, tracks: Array) -> Array:
        """Return ``tracks`` [..., 3] of the cameras in hinge coordinates, m."""
        return np.asarray((tracks - self.hinge) @ self.turn.T)


@one_blas_thread
def fit(strip: Strip, described: Array, tracks: Array, frames: Frames, start: Fit, *, steps: int = _STEPS) -> Fit:
    """Fit the frame of ``tracks`` [T, M, 3] (m; NaN where not seen) to ``described`` rest positions [M, 3], m.

    ``described`` are hinge coordinates; the tracks are in the order of the markers. ``start`` is where to begin.
    """
    seen: Mask = np.asarray(np.isfinite(tracks).all(axis=-1))
    pose = frames.shaking.covariance(start.turn, start.hinge)
    problem = _Problem(strip, described, tracks, seen, frames.mean, frames.slow, pose)
    if len(start.drift) != frames.slow.shape[1]:
        start = replace(start, drift=np.zeros((frames.slow.shape[1], _JITTER)))
    here = replace(start, residuals=problem.residuals(start), scatter=_FIRST_SCATTER * strip.span)
    here, damping = problem.scaled(here), 1e-4
    for _ in range(steps):
        step = _Step(problem, here)
        covariance, flap_error = step.errors()
        while True:
            there = problem.weighed(step.taken(damping))
            if there.cost <= here.cost + 1e-9 * abs(here.cost) or damping > 1e3:
                break
            damping *= 10
        turned, shifted = np.abs(there.turn - here.turn).max(), np.abs(there.hinge - here.hinge).max()
        damping, before = max(damping / 10, 1e-9), here.scatter
        here = problem.scaled(replace(there, covariance=covariance, flap_error=flap_error))
        settled = abs(here.scatter - before) < _SETTLED_SCATTER * before
        if settled and max(float(turned), float(shifted) / strip.span) < _SETTLED:
            break
    step = _Step(problem, here)
    covariance, flap_error = step.errors()
    costs = jitter_costs(here.jitter, problem.jitter_precision(here), step.A, here.memory)
    return replace(here, covariance=covariance, flap_error=flap_error, jitter_costs=costs)


@dataclass(frozen=True, eq=False)
class _Problem:
    """What does not change during a fit; arguments as of :func:`fit`, ``seen`` [T, M]."""

    strip: Strip
    described: Array
    tracks: Array
    seen: Mask
    mean: Array
    slow: Array
    pose: Array

    @property
    def drift_precision(self) -> Array:
        """Of the coefficients [D, 5] of slow motion."""
        shift = _SLOW_SHIFT * self.strip.span
        one = np.array([_SLOW_TURN, _SLOW_TURN, shift, shift, shift]) ** -2.0
        return np.tile(one, (self.slow.shape[1], 1))

    def jitter_precision(self, at: Fit) -> Array:
        """Of the jitter [5, 5] of each frame."""
        return jitter_precision(self.pose, at.shake, at.memory)

    def residuals(self, at: Fit) -> Array:
        model = positions(self.strip, at.rest, at.states, at.line)[0]
        return np.asarray(at.coordinates(self.tracks) - model - shaken(model, at.jitter + self.slow @ at.drift))

    def weighed(self, at: Fit) -> Fit:
        """Return ``at`` with its cost under its own noise and scatter."""
        squares = (at.residuals[self.seen] ** 2).sum(axis=-1)
        data = _CAUCHY**2 * np.log1p(squares / at.noise**2 / _CAUCHY**2).sum() + 6 * len(squares) * np.log(at.noise)
        moves = ((at.rest - self.described) ** 2).sum() / at.scatter**2 + 2 * at.rest.size * np.log(at.scatter)
        states = ((at.states / _STATE_PRIOR) ** 2).sum() / at.memory
        means = self.mean @ at.states[:, _ELASTIC]
        means = means @ _MEAN_PRECISION @ means
        line = (((at.line - self.strip.line) / (_LINE_PRIOR * self.strip.chord)) ** 2).sum()
        jitter = np.einsum("ta,ab,tb->", at.jitter, self.jitter_precision(at), at.jitter)
        drift = (at.drift**2 * self.drift_precision).sum()
        return replace(at, cost=float(data / at.memory + moves + states + jitter + means + line + drift))

    def scaled(self, at: Fit) -> Fit:
        """Return ``at`` with new estimates of noise, its memory, shake and scatter, and its cost under these."""
        squares = (at.residuals[self.seen] ** 2).sum(axis=-1)
        # The median of |r|^2 of three normal coordinates is 2.366 times their variance.
        noise = max(float(np.sqrt(np.median(squares) / 2.366)), _LEAST_NOISE * self.strip.span)
        memory = _memory(at.residuals, noise)
        shake = shake_of(at.residuals, self.seen, at.rest[:, 0], at.jitter, self.pose, noise, memory)
        at = replace(at, noise=noise, memory=memory, shake=shake)
        moves = ((at.rest - self.described) ** 2).ravel()
        scatter = at.scatter
        if at.covariance.size:  # MacKay (1992): squares over the number of coordinates that the tracks determine
            known = len(moves) - np.diag(at.covariance)[_FRAME:].sum() / scatter**2
            scatter = float(np.sqrt(moves.sum() / max(known, 1.0)))
        scatter = min(max(scatter, _LEAST_REST * self.strip.span), _MOST_REST * self.strip.span)
        return self.weighed(replace(at, scatter=scatter))


def _local_prior(memory: float, jitter: Array) -> Array:
    """Precision [_LOCAL, _LOCAL] of the states and the jitter of a frame; ``jitter`` [5, 5]: that of the jitter."""
    found = np.diag(np.concatenate([_STATE_PRIOR**-2.0 / memory, np.zeros(_JITTER)]))
    found[STATES:, STATES:] = jitter
    return found


def by_pose(q: Array) -> Array:
    """Derivatives [T, M, 3, 5] of positions ``q`` [T, M, 3] (m) by rotations about y and z and by a shift."""
    found = np.zeros((*q.shape, 5))
    x, y, z = np.moveaxis(q, -1, 0)
    found[..., 0, 0], found[..., 2, 0] = z, -x
    found[..., 0, 1], found[..., 1, 1] = -y, x
    found[..., 2:] = np.eye(3)
    return found


def shaken(q: Array, jitter: Array) -> Array:
    """Displacements [T, M, 3] of positions ``q`` [T, M, 3] by the ``jitter`` [T, 5], m."""
    return np.asarray(np.einsum("tmia,ta->tmi", by_pose(q), jitter))


def _memory(residuals: Array, noise: float) -> float:
    """Number of samples that count as one: (1 + r) / (1 - r) at the lag-1 autocorrelation r of the residuals."""
    cut = np.clip(residuals, -3 * noise, 3 * noise)
    now, then = cut[1:], cut[:-1]
    both = np.isfinite(now) & np.isfinite(then)
    if not both.any():
        return 1.0
    r = float((now[both] * then[both]).sum() / max((now[both] ** 2).sum(), 1e-300))
    r = min(max(r, _LEAST_CORRELATION), 0.95)
    return (1 + r) / (1 - r)


class _Step:
    """Linearised problem at one point, with the states eliminated.

    Unknowns of all frames: rotation, shift and line [7], rest positions [3 M], the forces that restrict the means of
    the elastic states [_MEANS] (dual variables, so that no frame is coupled to another), and slow motion [5 D].
    """

    def __init__(self, problem: _Problem, at: Fit) -> None:
        self.problem, self.at = problem, at
        T, M = problem.seen.shape
        q, by_state, by_rest, by_line = positions(problem.strip, at.rest, at.states, at.line)
        r = np.where(problem.seen[..., None], np.nan_to_num(at.residuals), 0.0)
        weight = problem.seen / (at.memory * at.noise**2 * (1 + (r**2).sum(-1) / (_CAUCHY * at.noise) ** 2))
        by_frame = np.concatenate([by_pose(q), by_line], axis=-1)
        by_state = np.concatenate([by_state, by_frame[..., :_JITTER]], axis=-1)
        J, free = weight[..., None, None] * by_state, _FRAME + 3 * M
        prior = _local_prior(at.memory, problem.jitter_precision(at))
        seen_only, pull = np.einsum("tmia,tmib->tab", J, by_state), np.einsum("tmia,tmi->ta", J, r)
        self.A, self.a = seen_only + prior, pull - np.hstack([at.states, at.jitter]) @ prior
        slow, drifts = problem.slow, slice(free + _MEANS, free + _MEANS + at.drift.size)
        self.free, self.drifts = free, drifts
        self.B = np.zeros((T, drifts.stop, _LOCAL))
        self.B[:, :_FRAME] = np.einsum("tmia,tmib->tab", by_frame, J)
        self.B[:, _FRAME:free] = np.einsum("tmia,tmib->tmab", by_rest, J).reshape(T, 3 * M, _LOCAL)
        self.B[:, free : drifts.start, _ELASTIC] = problem.mean[:, None, None] * np.eye(_MEANS)
        # Slow motion is a jitter that all frames share, times polynomials.
        self.B[:, drifts] = np.einsum("td,tab->tdab", slow, seen_only[:, STATES:]).reshape(T, at.drift.size, _LOCAL)
        weighted = weight[..., None, None] * by_rest
        C = np.zeros((drifts.stop, drifts.stop))
        C[:_FRAME, :_FRAME] = np.einsum("tm,tmia,tmib->ab", weight, by_frame, by_frame)
        C[:_FRAME, _FRAME:free] = np.einsum("tmia,tmib->amb", by_frame, weighted).reshape(_FRAME, 3 * M)
        C[_FRAME:free, :_FRAME] = C[:_FRAME, _FRAME:free].T
        blocks = np.einsum("tmia,tmib->mab", by_rest, weighted) + np.eye(3) / at.scatter**2
        for m in range(M):
            here = slice(_FRAME + 3 * m, _FRAME + 3 * m + 3)
            C[here, here] = blocks[m]
        C[free : drifts.start, free : drifts.start] = -_MEAN_PRIOR
        C[:free, drifts] = np.einsum("tga,td->gda", self.B[:, :free, STATES:], slow).reshape(free, at.drift.size)
        C[drifts, :free] = C[:free, drifts].T
        C[drifts, drifts] = np.einsum("tga,td->gda", self.B[:, drifts, STATES:], slow).reshape([at.drift.size] * 2)
        C[drifts, drifts] += np.diag(problem.drift_precision.ravel())
        self.C = C
        by_all = np.einsum("tmia,tmi->ma", weighted, r) - (at.rest - problem.described) / at.scatter**2
        restricted = np.diag([0.0] * 5 + [(_LINE_PRIOR * problem.strip.chord) ** -2.0] * 2)
        C[:_FRAME, :_FRAME] += restricted
        common = np.einsum("tm,tmia,tmi->a", weight, by_frame, r)
        common[5:] -= restricted[5:, 5:] @ (at.line - problem.strip.line)
        shared = slow.T @ pull[:, STATES:] - problem.drift_precision * at.drift
        self.c = np.concatenate([common, by_all.ravel(), -(problem.mean @ at.states[:, _ELASTIC]), shared.ravel()])

    def _reduced(self, damping: float) -> tuple[Array, Array, Array]:
        grown = self.A + damping * np.einsum("tab,ab->tab", self.A, np.eye(_LOCAL))
        solved = np.linalg.solve(grown, np.swapaxes(self.B, 1, 2))  # [T, STATES, G]
        S = self.C + damping * np.diag(np.maximum(np.diag(self.C), 0))
        S -= np.einsum("tga,tah->gh", self.B, solved, optimize=True)
        return grown, solved, S

    def taken(self, damping: float) -> Fit:
        """Return the fit after one step."""
        grown, solved, S = self._reduced(damping)
        d = np.linalg.solve(S, self.c - np.einsum("tag,ta->g", solved, self.a))
        states = np.linalg.solve(grown, self.a[..., None])[..., 0] - np.einsum("tag,g->ta", solved, d)
        there = replace(
            self.at,
            turn=Rotation.from_rotvec([0.0, d[0], d[1]]).as_matrix().T @ self.at.turn,
            hinge=self.at.hinge + self.at.turn.T @ d[2:5],
            states=self.at.states + states[:, :STATES],
            jitter=self.at.jitter + states[:, STATES:],
            line=self.at.line + d[5:_FRAME],
            rest=self.at.rest + d[_FRAME : self.free].reshape(-1, 3),
            drift=self.at.drift + d[self.drifts].reshape(-1, _JITTER),
        )
        return replace(there, residuals=self.problem.residuals(there))

    def errors(self) -> tuple[Array, float]:
        """Return the covariance of frame, line and rest positions, and the standard error of the mean flap angle."""
        grown, solved, S = self._reduced(0.0)
        whole = np.linalg.inv(S)
        first = np.zeros(_LOCAL)
        first[0] = 1.0
        alone = np.linalg.solve(grown, np.broadcast_to(first, (len(grown), _LOCAL))[..., None])[:, 0, 0]
        common = np.einsum("t,tg->g", self.problem.mean, solved[:, 0])
        variance = float((self.problem.mean**2) @ alone + common @ whole @ common)
        return np.asarray(whole[: self.free, : self.free]), float(np.sqrt(max(variance, 0.0)))


def states_of(
    strip: Strip, tracks: Array, at: Fit, shaking: PoseError, slow: Array, flap: Array
) -> tuple[Array, Array]:
    """Return states [T, STATES] and motion of the body [T, 5] in ``tracks`` [T, M, 3] (m), else as in the fit ``at``.

    The motion is slow motion, with the polynomials ``slow`` [T, D], and jitter. ``flap`` [T]: where the flap angle
    begins, rad. The tracks are in the order of the fit's rest positions.
    """
    drift = slow @ at.drift
    local = np.zeros((len(tracks), _LOCAL))
    local[:, 0] = flap
    pose = shaking.covariance(at.turn, at.hinge)
    prior = _local_prior(at.memory, jitter_precision(pose, at.shake, at.memory))
    seen: Mask = np.asarray(np.isfinite(tracks).all(axis=-1))
    measured = at.coordinates(np.nan_to_num(tracks))
    for _ in range(_STATE_STEPS):
        q, J, _, _ = positions(strip, at.rest, local[:, :STATES], at.line)
        r = np.where(seen[..., None], measured - q - shaken(q, drift + local[:, STATES:]), 0.0)
        J = np.concatenate([J, by_pose(q)], axis=-1)
        weight = seen / (at.memory * at.noise**2 * (1 + (r**2).sum(-1) / (_CAUCHY * at.noise) ** 2))
        A = np.einsum("tm,tmia,tmib->tab", weight, J, J, optimize=True) + prior
        a = np.einsum("tm,tmia,tmi->ta", weight, J, r, optimize=True) - local @ prior
        local += np.linalg.solve(A, a[..., None])[..., 0]
    return local[:, :STATES], drift + local[:, STATES:]
