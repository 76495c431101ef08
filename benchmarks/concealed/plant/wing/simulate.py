"""Simulates one beat of the periodic motion of a wing with hidden effects; returns the true marker positions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.signal import resample

from benchmarks.concealed.plant.wing.build import Draft, rig_of
from benchmarks.concealed.plant.wing.integrator import State
from benchmarks.concealed.plant.wing.motor import driven
from benchmarks.concealed.plant.wing.periodic import Accuracy
from benchmarks.concealed.plant.wing.rig import Rig, states_of
from benchmarks.concealed.plant.wing_effects.hidden import Effect, Hidden, Truth
from wingfit.records import Condition, Wing

Array = npt.NDArray[np.float64]

SAMPLES = 192  # least number of instants in a beat


@dataclass(frozen=True, eq=False)
class Beat:
    """One simulated beat of a wing's periodic motion.

    Attributes:
        wing: the wing that was simulated.
        tracks: [n, M, 3] true positions of all markers in the wing's order, at n equal steps of the drive phase from 0,
            m.
        hidden: effects that are hidden in it.
        turns: drive phase (rad) at which an effect acts, by its name, for those whose phase follows from the motion.
        error: estimated distance from the periodic motion, m.
        beats: number of beats that were integrated.
        crossing: drive phase (rad) at which the reference markers rise through the height of the hinge: the start of
            the beat as a dataset defines it.
    """

    wing: Wing
    tracks: Array
    hidden: Hidden
    turns: Mapping[str, float]
    error: float
    beats: int

    @property
    def truths(self) -> tuple[Truth, ...]:
        """The hidden effects as a diagnosis should report them; :meth:`phase` converts their ``turn`` to beats."""
        return self.hidden.truths(self.wing, self.turns)

    @cached_property
    def crossing(self) -> float:
        """Drive phase (rad) at which the reference markers rise through the hinge's height: start of a dataset's beat.

        ValueError if they never do.
        """
        names = [marker.name for marker in self.wing.markers]
        columns = [names.index(name) for name in self.wing.reference_markers]
        height = self.tracks[:, columns, 2].mean(axis=1) - self.wing.hinge.z
        rising = np.flatnonzero((height <= 0) & (np.roll(height, -1) > 0))
        if len(rising) == 0:
            raise ValueError("the reference markers never rise through the height of the hinge; choose others")
        slope = np.roll(height, -1) - height
        k = int(rising[np.argmax(slope[rising])])
        return float(2 * np.pi * (k - height[k] / slope[k]) / len(height))

    def phase(self, psi: float) -> float:
        """Convert drive phase ``psi`` (rad) to beats, 0 to 1, from the start of a beat as a dataset defines it."""
        return float((psi - self.crossing) / (2 * np.pi) % 1.0)


def simulate(
    wing: Wing,
    division: str,
    genome: Mapping[str, float],
    condition: Condition,
    hidden: Hidden | None = None,
    accuracy: Accuracy | None = None,
) -> Beat:
    """Simulate one periodic beat of ``wing``.

    ``genome``: model parameters by name (van der Grinten's thesis, Eqs. 18-19), SI units. ``division`` as in
    :func:`.geometry.counts_of`. ArithmeticError if there is no periodic motion.
    """
    draft = Draft(wing, division, genome, condition)
    concealed = hidden or Hidden()
    concealed.put_into(draft)
    rig = rig_of(draft)
    cut = draft.cut
    places = np.array([marker.position for marker in wing.markers])
    carrier = cut.under(places[:, 0], places[:, 1])
    arms = places - cut.bodies[1][carrier]
    R, p, error, beats = driven(rig, draft, at_rest(rig), accuracy or Accuracy())
    tracks = p[:, carrier] + np.einsum("tmij,mj->tmi", R[:, carrier], arms)
    if len(tracks) < SAMPLES:
        tracks = np.asarray(resample(tracks, SAMPLES, axis=0))
    turns = {e.name: _middle(draft, e, R, p) for e in concealed.effects if e.kind.acting}
    return Beat(wing, tracks, concealed, turns, error, beats)


def _middle(draft: Draft, effect: Effect, R: Array, p: Array) -> float:
    """Drive phase (rad) at which an effect acts: circular mean weighted by magnitudes above half the maximum."""
    if effect.kind.acting is None:
        raise ValueError(f"{effect.name} has no phase that the motion determines")
    body, arm, _ = draft.at(effect.values["span"], effect.values.get("chord", 0.5))
    height = p[:, body, 2] + R[:, body, 2] @ arm
    rate = np.gradient(np.concatenate([height[-1:], height, height[:1]]))[1:-1] * len(height)
    size = effect.kind.acting(draft, effect.values, height, rate * draft.condition.flap_frequency)
    turn = np.exp(2j * np.pi * np.arange(len(size)) / len(size))
    return float(np.angle((np.where(size > 0.5 * size.max(), size, 0.0) * turn).sum()) % (2 * np.pi))


def at_rest(rig: Rig) -> State:
    """Initial state of ``rig``: the undeformed wing at rest, with all internal states zero."""
    n = len(rig.mass)
    return State(
        np.tile(np.eye(3), (n, 1, 1)), rig.rest.copy(), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(states_of(rig))
    )
