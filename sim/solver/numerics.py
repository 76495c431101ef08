"""How well to solve: the accuracy that a user states, and the ladder of steps that leads to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records import Condition

ACCURACY = 1e-4
# Steps of a beat to try, one after the other: each half as many again, so that successive motions share instants.
LADDER = (64, 96, 144, 216, 324, 486, 729)
STEPS_PER_HZ = 21.0  # no beat starts below: the faster a wing flaps, the nearer its harmonics come to its resonances
KINKS = 2e-5  # m
SAFETY = 1.5  # soft wings with hardly any damping have been seen to need it
_ORDER = 4
_GROWTH = 1.5


@dataclass(frozen=True)
class Numerics:
    """How well to solve.

    Attributes:
        accuracy: largest distance (m) of any marker at any instant from where the exact periodic motion of the model
            has it. The number of steps is raised, individual by individual, until the estimated error is below.
        steps: per beat; given, it is taken as it is and no error is estimated.
        ramp_beats: the drive's amplitude grows from rest over these first beats.
        max_beats: after which a wing that is still not periodic is reported.
        periodic: distance (m) to the periodic motion at which a beat counts as periodic; None takes a quarter of the
            accuracy.
        window: beats that the acceleration towards the periodic motion learns from; 0 waits for transients to die.
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
            raise ValueError(f"window is {self.window} beats; it must be at least 0, which learns nothing from them")

    def ladder(self, condition: Condition) -> tuple[int, ...]:
        """Steps of a beat to try under a condition, coarsest first."""
        if self.steps is not None:
            return (self.steps,)
        least = STEPS_PER_HZ * condition.flap_frequency
        # an error is what two rungs differ by
        return tuple(n for n in LADDER if n >= least or n in LADDER[-2:])

    @property
    def settled(self) -> float:
        """Distance (m) to the periodic motion that counts as periodic."""
        return 0.25 * self.accuracy if self.periodic is None else self.periodic


def estimated_error(changes: list[float]) -> float:
    """Error (m) of the latest motion from what each refinement changed (m), as a geometric series.

    One change tells no order: the second is assumed. With more it is what is seen, up to one above the method's.
    Below KINKS a change may come from the corners in the law of the air, which fall with the second order only.
    """
    least = _GROWTH**2
    ratio = least
    if len(changes) > 1:
        seen = changes[-2] / max(changes[-1], np.finfo(float).tiny)
        ratio = float(np.clip(seen, least, _GROWTH ** (_ORDER + 1)))
    return SAFETY * max(changes[-1] / (ratio - 1.0), min(changes[-1], KINKS) / (least - 1.0))
