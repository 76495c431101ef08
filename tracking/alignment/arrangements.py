"""Every way the described wing can lie on the tracks, fitted; and whether the best one is the only one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

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
_LARGEST_SCATTER = 0.01  # of rest positions, spans
_ROUNDS = 4  # of relabelling
_FIRST_STEPS, _STEPS = 8, 40
LEAST_MARKERS = 4


@dataclass(frozen=True, eq=False)
class Arrangement:
    """A fit with the markers of the tracks.

    Attributes:
        marker: [K] of each track; -1 for none.
        doubtful: [K] whether another marker is nearly as near.
        away: [K, M] RMS distance of each track from each marker, m.
        fit: of the matched tracks, in the order of ``marker``'s tracks.
        samples: [K] count of the frames that show each track.
    """

    marker: Index
    doubtful: Mask
    away: Array
    fit: Fit
    samples: Index

    def cost(self, described: Array, noise: float, memory: float, span: float, every: Mask) -> float:
        """Minus twice the log-likelihood of the tracks in ``every`` [K] under a common ``noise`` (m) and ``memory``.

        A sample costs at most what one that fits no marker costs. So do all those of tracks that are no marker.
        """
        squares = (self.fit.residuals**2).sum(axis=-1) / noise**2
        data = np.nansum(np.minimum(9 * np.log1p(squares / 9), _CUT))
        data += _CUT * self.samples[every & (self.marker < 0)].sum()
        moves = self.fit.rest - described[self.marker[self.marker >= 0]]
        scatter = self.fit.scatter
        rest = (moves**2).sum() / scatter**2 + 6 * len(moves) * np.log(scatter / (_LARGEST_SCATTER * span))
        return float(data / memory + rest)


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
        return Arrangement(marker, doubtful, away, here, np.isfinite(self.tracks[..., 0]).sum(axis=0))


def _with_given(marker: Index, given: Index) -> Index:
    found = marker.copy()
    for track in np.flatnonzero(given >= 0):
        found[(found == given[track])] = -1
        found[track] = given[track]
    return found


def ranked(found: Sequence[Arrangement], described: Array, span: float) -> list[tuple[float, Arrangement]]:
    """Return the arrangements, best first, each with by how much its cost exceeds the best one's."""
    noise, memory = min(one.fit.noise for one in found), max(one.fit.memory for one in found)
    every = np.any([one.marker >= 0 for one in found], axis=0)
    costs = [one.cost(described, noise, memory, span, every) for one in found]
    order = np.argsort(costs)
    return [(costs[k] - costs[order[0]], found[k]) for k in order]
