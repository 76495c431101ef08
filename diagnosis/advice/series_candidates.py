"""What could be recorded next with a rig that the user simulates.

Candidates are the recorded experiments with one thing changed: another start (genes of the recording, within their
bounds), a setting with the value of another recording, inputs of another size (up to the largest recorded one).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wingfit.records import Series

STARTS = (0.5, 2.0)  # times the genes of a recording
SMALLER = 0.5  # times the inputs
LEAST_CHANGE = 1.1  # times: a larger input that is less is not tried
STEPS = 16  # factors of inputs are multiples of 1 / STEPS, so that they can be sent exactly


@dataclass(frozen=True)
class Candidate:
    """A recorded experiment with changed settings or inputs, or with its own genes multiplied by ``start``."""

    recording: Series
    change: str
    start: float = 1.0


def candidates(recordings: Sequence[Series]) -> Iterator[Candidate]:
    """Yield the experiments that are compared, the recorded ones first; repeats of one experiment count once."""
    distinct = list({f"repeats {one.repeats}" if one.repeats else one.name: one for one in recordings[::-1]}.values())[
        ::-1
    ]
    for one in distinct:
        yield Candidate(one, "as it was")
    for one in distinct:
        for factor in STARTS:
            yield Candidate(one, f"with a start {factor:g} times as large", factor)
    for one in distinct:
        for name in one.settings:
            for value in sorted({other.settings[name] for other in distinct} - {one.settings[name]}):
                changed = replace(one, settings={**one.settings, name: value})
                yield Candidate(changed, f"with {name} {value:g}")
        for factor in _input_factors(one, distinct):
            changed = replace(one, inputs={name: factor * values for name, values in one.inputs.items()})
            yield Candidate(changed, f"with inputs {factor:g} times as large")


def _input_factors(one: Series, recordings: Sequence[Series]) -> Iterator[float]:
    """Yield the factors of the inputs of a recording: a smaller one, and that to the largest recorded input."""
    largest = [max(float(np.abs(r.inputs[name]).max()) for r in recordings) for name in one.inputs]
    own = [float(np.abs(values).max()) for values in one.inputs.values()]
    if not any(own):
        return
    yield SMALLER
    most = np.floor(STEPS * min(a / b for a, b in zip(largest, own, strict=True) if b > 0.0)) / STEPS
    if most >= LEAST_CHANGE:
        yield float(most)
