"""Settings of the solver: the requested accuracy, and the sequence of step numbers that is tried to reach it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records import Condition

ACCURACY = 1e-4
# Steps per beat to try in turn: each 1.5 times the one before, so that successive motions share instants.
LADDER = (64, 96, 144, 216, 324, 486, 729)
STEPS_PER_HZ = 21.0  # least steps per beat: the faster a wing flaps, the closer its harmonics are to its resonances
KINKS = 2e-5  # m
SAFETY = 1.5  # needed by soft wings with little damping
_ORDER = 4
_GROWTH = 1.5


@dataclass(frozen=True)
class Numerics:
    """Settings of the solver.

    Attributes:
        accuracy: largest error (m) of any marker at any instant, relative to the exact periodic motion of the model.
            The number of steps is raised, for each individual, until the estimated error is smaller.
        steps: number of steps per beat. If given, it is not changed and no error is estimated.
        ramp_beats: number of beats over which the amplitude of the drive grows from zero.
        max_beats: number of beats after which a motion that is not periodic counts as failed.
        periodic: distance (m) to the periodic motion at which a beat counts as periodic; None: a quarter of
            ``accuracy``.
        window: number of past beats that Anderson acceleration uses; 0: no acceleration.
    """

    accuracy: float = ACCURACY
    steps: int | None = None
    ramp_beats: int = 1
    max_beats: int = 24
    periodic: float | None = None
    window: int = 8

    def __post_init__(self) -> None:
        if (self.steps is not None and self.steps < 8) or self.ramp_beats < 1 or self.max_beats <= self.ramp_beats:
            raise ValueError(
                f"{self} is not usable: at least 8 steps a beat, at least one beat of ramp and more beats than that"
            )
        if not (np.isfinite(self.accuracy) and self.accuracy > 0):
            raise ValueError(f"accuracy is {self.accuracy!r} m; it must be a positive number such as 1e-4 (0.1 mm)")
        if self.periodic is not None and not self.periodic > 0:
            raise ValueError(
                f"periodic is {self.periodic!r} m; it must be positive, such as 2.5e-5 (0.025 mm), or None"
            )
        if self.window < 0:
            raise ValueError(f"window is {self.window} beats; it must be at least 0 (no acceleration)")

    def ladder(self, condition: Condition) -> tuple[int, ...]:
        """Return the numbers of steps per beat to try in turn under ``condition``, smallest first."""
        if self.steps is not None:
            return (self.steps,)
        least = STEPS_PER_HZ * condition.flap_frequency
        # two are needed to estimate an error
        return tuple(n for n in LADDER if n >= least or n in LADDER[-2:])

    @property
    def settled(self) -> float:
        """Distance (m) to the periodic motion below which a beat counts as periodic."""
        return 0.25 * self.accuracy if self.periodic is None else self.periodic


def estimated_error(changes: list[float]) -> float:
    """Estimate the error (m) of the motion at the finest step by Richardson extrapolation.

    ``changes`` (m): largest change of a marker at each refinement of the step, coarsest first. The order of convergence
    is estimated from the last two changes and limited to 2...5; with one change it is taken as 2. Changes below KINKS
    may come from the kinks in the law of the air, where convergence is of order 2 only.
    """
    least = _GROWTH**2
    ratio = least
    if len(changes) > 1:
        seen = changes[-2] / max(changes[-1], np.finfo(float).tiny)
        ratio = float(np.clip(seen, least, _GROWTH ** (_ORDER + 1)))
    return SAFETY * max(changes[-1] / (ratio - 1.0), min(changes[-1], KINKS) / (least - 1.0))
