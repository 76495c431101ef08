"""What a diagnosis proposes to record next; plain data, part of the finding."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

AdviceKind = Literal["condition", "repeat", "markers", "sensor"]


@dataclass(frozen=True)
class AdvisedCondition:
    """A condition of a flapping rig to record; ``airspeed`` in m/s."""

    flap_frequency_hz: float
    phase_lag_deg: float
    pressure_mbar: float
    airspeed: float
    angle_of_attack_deg: float


@dataclass(frozen=True)
class AdvisedCost:
    """What a proposal costs: number of ``recordings``, of ``frames`` or samples in all, and ``seconds`` of recording.

    ``beats`` in all; None for a rig without a beat.
    """

    recordings: int
    frames: int
    seconds: float
    beats: float | None = None


@dataclass(frozen=True)
class AdvisedPlace:
    """Where a marker should be: ``span`` from the root and ``chord`` from the leading edge, 0 to 1; ``x``, ``y`` in m.

    ``separation``: of the hypotheses there, as that of :class:`Advice`; ``marker``: name of the described one that is
    there; None: there is none yet.
    """

    span: float
    chord: float
    x: float
    y: float
    separation: float
    marker: str | None = None


@dataclass(frozen=True)
class Advice:
    """What to record next, because predictions of the hypotheses ``between`` differ there.

    Attributes:
        words: the proposal, for display.
        separation: root mean square difference of the predictions, as far as genes cannot adapt, in standard deviations
            of the noise of a sample.
        resolves: probability that a diagnosis with the new recording names the right hypothesis and no other; None
            where it cannot be computed.
        between: names of the hypotheses.
        condition: of a flapping rig; None of any other.
        recording: that is made again, with the ``change`` of a rig without a beat; None for a new condition.
        change: see ``recording``.
        kind: another condition, a recorded one again, with other markers, or with another sensor.
        cost: None in findings of earlier versions.
        beyond: settings outside of what was recorded; the rig must allow them.
        places: of further markers, the one that shows most first.
        channels: that a further sensor measures.
    """

    words: str
    separation: float
    resolves: float | None
    between: tuple[str, ...]
    condition: AdvisedCondition | None = None
    recording: str | None = None
    change: str | None = None
    kind: AdviceKind = "condition"
    cost: AdvisedCost | None = None
    beyond: tuple[str, ...] = ()
    places: tuple[AdvisedPlace, ...] = ()
    channels: tuple[str, ...] = ()
