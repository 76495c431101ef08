"""What a running diagnosis knows so far: where the nominal model misses, and which hypotheses lead the search."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PlaceMisfit:
    """Misfit of the nominal model at a marker, in a force axis or in a channel: root mean square beyond the noise.

    ``misfit`` in ``unit``; ``x`` and ``y`` in m on the wing, None without a place.
    """

    name: str
    unit: str
    misfit: float
    x: float | None = None
    y: float | None = None


@dataclass(frozen=True)
class Lead:
    """Effects that may be missing, and the fraction of the misfit beyond the noise that they explain.

    ``refitted``: they were added to the model and fitted; else a score test predicts the fraction.
    """

    effects: tuple[str, ...]
    title: str
    explained: float
    refitted: bool


@dataclass(frozen=True)
class PartialFinding:
    """The state of a search; it can still change, and gives no probabilities.

    Attributes:
        unit: of ``noise`` and ``misfit``: "m", "N", or "1" (multiples of the noise or range) for series.
        noise: root mean square of the noise of one channel.
        misfit: root mean square misfit of the fitted nominal model, noise included.
        places: where it lies.
        outline: of the wing, (x, y) in m; empty for forces and series.
        leads: leading hypotheses, that which explains most first.
        tested: number of effects that were score-tested.
        suspects: number of effects to test.
    """

    unit: str
    noise: float
    misfit: float
    places: tuple[PlaceMisfit, ...]
    outline: tuple[tuple[float, float], ...]
    leads: tuple[Lead, ...]
    tested: int
    suspects: int
