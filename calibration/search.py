"""What a calibration is made of, from the outside: its specification, its progress and its result."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from calibration.evaluator import Evaluator
from records import Dataset

Mode = Literal["staged", "joint"]


@dataclass(frozen=True)
class CalibrationSpec:
    """What to calibrate and how; the defaults are the thesis's (IV-E).

    Attributes:
        division: preset ("4", "11", "24") or strips as "3,3,3,2" (bodies along the chord of each strip, root first).
        mode: "staged" fits structural genes on vacuum recordings, then aerodynamic ones on the rest; "joint" fits all.
        population: individuals per generation.
        stall: generations without improvement of the best fitness after which a stage ends.
        tolerance: relative improvement that counts as one.
        max_generations: per stage.
        seed: the same seed gives the same numbers, bit for bit.
        bounds_factor: the box is [estimate / factor, estimate * factor].
        recordings: names to fit; empty means all that are not held out.
        genes: names to search; empty means all.
    """

    division: str = "11"
    mode: Mode = "staged"
    population: int = 50
    stall: int = 10
    tolerance: float = 1e-3
    max_generations: int = 200
    seed: int = 1
    bounds_factor: float = 5.0
    recordings: tuple[str, ...] = ()
    genes: tuple[str, ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Generation:
    """One finished generation, what a watcher sees; ``checkpoint`` (JSON) is all that is needed to go on from here.

    ``distance`` is the best individual's mean distance per marker in m; ``diversity`` the mean over the free genes of
    the population's standard deviation in unit coordinates; ``progress`` a fraction of the whole calibration (an
    estimate, non-decreasing, 1 only at the end).
    """

    stage: str
    index: int
    best: float
    mean: float
    diversity: float
    distance: float
    evaluations: int
    failed: int
    genome: dict[str, float]
    progress: float
    checkpoint: dict[str, Any]


def calibrate(
    spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, checkpoint: dict[str, Any] | None = None
) -> Iterator[Generation]:
    """Run the calibration, yielding after each generation; with ``checkpoint``, go on from there.

    Resumed equals uninterrupted, bit for bit. ValueError when the spec does not fit the dataset.
    """
    raise NotImplementedError
