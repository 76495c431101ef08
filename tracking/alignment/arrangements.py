"""Every way the described wing can lie on the tracks, fitted; and whether the best one is the only one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from wingfit.records.array_types import Array, Index, Mask
from wingfit.tracking.alignment.candidates import Candidate, Layout, candidates, gate_of, start_of, with_all
from wingfit.tracking.alignment.fit import Fit, fit, shaken
from wingfit.tracking.alignment.identity import whole_tracks
from wingfit.tracking.alignment.pose_error import Frames
from wingfit.tracking.alignment.rigid_motion import RigidMotion
from wingfit.tracking.alignment.wing_model import Strip, positions

DISTINCT = 12.0
"""Minus twice the log-likelihood by which an arrangement must be worse to be excluded: 0.25 % of the other's weight."""
_NEAR = 2.0  # candidates whose misfit is up to as many times the best one's are fitted
_MOST = 3  # candidates that are fitted
_CUT = 9.0 * np.log1p(100.0 / 9.0)  # cost of a sample that fits no marker, 10 standard deviations away
_ROUNDS = 4  # of relabelling
_FIRST_STEPS, _STEPS = 8, 40
LEAST_MARKERS = 4


class Costs(NamedTuple):
    """Minus twice a log-likelihood: of the ``frames`` [T], and of the described ``rest`` positions."""

    frames: Array
    rest: float

    @property
    def total(self) -> float:
        """Of everything."""
        return float(self.frames.sum()) + self.rest


@dataclass(frozen=True, eq=False)
class Arrangement:
    """A fit with the markers of the tracks.

    Attributes:
        marker: [K] of each track; -1 for none.
        doubtful: [K] whether another marker is nearly as near.
        away: [K, M] RMS distance of each track from each marker, m.
        fit: of the matched tracks, in the order of ``marker``'s tracks.
        seen: [T, K] whether each frame shows each track.
    """

    marker: Index
    doubtful: Mask
    away: Array
    fit: Fit
    seen: Mask

    def costs(self, described: Array, noise: float, memory: float, every: Mask) -> Costs:
        """Minus twice the log-likelihood of the tracks in ``every`` [K] under a common ``noise`` (m) and ``memory``.

        A sample costs at most what one that fits no marker costs. So do all those of tracks that are no marker.
        """
        squares = (self.fit.residuals**2).sum(axis=-1) / noise**2
        data = np.nansum(np.minimum(9 * np.log1p(squares / 9), _CUT), axis=1)
        data += _CUT * self.seen[:, every & (self.marker < 0)].sum(axis=1)
        jitter = self.fit.jitter_costs * self.fit.memory
        moves = self.fit.rest - described[self.marker[self.marker >= 0]]
        scatter = self.fit.scatter
        # Integrated over frame and rest positions (Laplace): else a scatter that goes to zero would win.
        rest = (moves**2).sum() / scatter**2 + 2 * moves.size * np.log(scatter)
        rest -= np.linalg.slogdet(self.fit.covariance)[1]
        return Costs((data + jitter) / memory, float(rest))


@dataclass(frozen=True, eq=False)
class Search:
    """What all arrangements share: ``described`` [M, 3] hinge coordinates (m), tracks [T, K, 3], their rigid motion."""

    strip: Strip
    described: Array
    tracks: Array
    motion: RigidMotion
    layout: Layout
    frames: Frames

    def candidates(self, given: Index) -> list[Candidate]:
        """Return the candidates to fit, best first; ``given`` [K] are markers of named tracks (-1: none)."""
        flat = self.described[:, :2]
        found = candidates(self.layout, flat, self.strip.span, None)
        if (given >= 0).sum() >= 3:
            found = candidates(self.layout, flat, self.strip.span, given)[:1] + found
        best = min(one.misfit for one in found)
        kept = list[Candidate]()
        for one in sorted(found, key=lambda one: one.misfit):
            alike = any(np.array_equal(one.marker, other.marker) and one.sense == other.sense for other in kept)
            if (
                one.misfit <= _NEAR * best + 1e-3 * self.strip.span
                and not alike
                and (one.marker >= 0).sum() >= LEAST_MARKERS
            ):
                kept.append(one)
        return kept[:_MOST]

    def _exchangeable(self, marker: Index, here: Fit, named: Index) -> Mask:
        """Return the tracks [K] whose labels could be exchanged at little cost, but for those named so."""
        which = marker[marker >= 0]
        squares = ((here.rest[:, None] - self.described[which][None]) ** 2).sum(axis=-1) / here.scatter**2
        own = np.diag(squares)
        cost = squares + squares.T - own[:, None] - own[None]
        np.fill_diagonal(cost, np.inf)
        found = np.zeros(len(marker), dtype=bool)
        found[marker >= 0] = (cost < DISTINCT).any(axis=1)
        return np.asarray(found & (named != marker))

    def _fitted(self, here: Fit, marker: Index, rest: Array, steps: int) -> Fit:
        which = marker[marker >= 0]
        start, tracks = with_all(here, rest[which]), self.tracks[:, marker >= 0]
        return fit(self.strip, self.described[which], tracks, self.frames, start, steps=steps)

    def arranged(self, candidate: Candidate, right: bool, given: Index, named: Index) -> Arrangement | None:
        """Return the fit that starts from ``candidate``, relabelled until labels and fit agree; None without fit."""
        here = start_of(candidate, self.layout, self.motion, right, self.described, self.strip)
        marker, rest, gate = candidate.marker, self.described.copy(), gate_of(self.described[:, :2])
        for round_ in range(_ROUNDS):
            if (marker >= 0).sum() < LEAST_MARKERS:
                return None
            here = self._fitted(here, marker, rest, _FIRST_STEPS if round_ == 0 else _STEPS)
            rest = self.described.copy()
            rest[marker[marker >= 0]] = here.rest
            # Described rest positions: estimated ones would confirm wrong labels.
            model = positions(self.strip, self.described, here.states, here.line)[0]
            model += shaken(model, here.jitter + self.frames.slow @ here.drift)
            found, away, doubtful = whole_tracks(here.coordinates(self.tracks), model, gate)
            found = _with_given(found, given)
            if round_ > 0 and np.array_equal(found, marker):
                break
            marker = found
        else:
            if (marker >= 0).sum() < LEAST_MARKERS:
                return None
            here = self._fitted(here, marker, rest, _STEPS)
        doubtful = doubtful | self._exchangeable(marker, here, named)
        return Arrangement(marker, doubtful, away, here, np.isfinite(self.tracks[..., 0]))


def _with_given(marker: Index, given: Index) -> Index:
    found = marker.copy()
    for track in np.flatnonzero(given >= 0):
        found[(found == given[track])] = -1
        found[track] = given[track]
    return found


def ranked(found: Sequence[Arrangement], described: Array) -> list[tuple[float, Arrangement]]:
    """Return the arrangements, best first, each with by how much its cost exceeds the best one's.

    For the other side than the best one's, the excess is at most what its scatter between the frames allows.
    """
    noise, memory = min(one.fit.noise for one in found), max(one.fit.memory for one in found)
    every = np.any([one.marker >= 0 for one in found], axis=0)
    costs = [one.costs(described, noise, memory, every) for one in found]
    best = min(range(len(found)), key=lambda k: costs[k].total)
    right = found[best].fit.right
    excess = [
        one.total - costs[best].total if arranged.fit.right == right else sure_of(costs[best], one, memory)
        for one, arranged in zip(costs, found, strict=True)
    ]
    return [(excess[k], found[k]) for k in np.argsort(excess, kind="stable")]


def sure_of(less: Costs, more: Costs, memory: float) -> float:
    """Return twice the ln of the odds for the model with ``less`` cost than another one, with ``more``.

    Both models are wrong in detail, and errors that markers of a frame share, or neighbouring frames, let the
    difference of their log-likelihoods vary more than the likelihoods say. So the odds are at most those that the
    difference is positive, if its standard error is that of a sum over frames (Vuong 1989, with the covariances of
    Newey and West 1987 up to two ``memory``).
    """
    each = more.frames - less.frames
    total, e = more.total - less.total, each - each.mean()
    lags = min(math.ceil(2 * memory), len(e) - 1)
    shared = sum((1 - k / (lags + 1)) * float(e[:-k] @ e[k:]) for k in range(1, lags + 1))
    error = math.sqrt(max(float(e @ e), float(e @ e) + 2 * shared))
    return min(total, -2 * float(scipy.stats.norm.logsf(total / max(error, 1e-300))))
