"""Whether the recordings refute the stated errors of the frame of the tracks."""

from __future__ import annotations

import numpy as np

from wingfit.diagnosis.evidence.frame_error import deviations
from wingfit.diagnosis.search_state import SearchState
from wingfit.diagnosis.verdict.verdict import decide

REFUTED = 6.0
"""Standard errors by which a frame is wrong at most; missing physics biases an alignment, so that 3 are not rare."""


def frame_refuted(state: SearchState) -> str | None:
    """Return a remark if the best explanation needs a frame that is far more wrong than stated; else None.

    A diagnosis that allows for an error takes a large one for a small part of the misfit, however unlikely it is. Such
    a frame must compete with other faults, as one that counts as exact does.
    """
    errors = state.position_errors
    if errors is None or errors.frame is None:
        return None
    decision = decide(state.final_weights)
    best = state.fitted_nominal.refit if decision.verdict == "adequate" else decision.best
    apart = np.abs(errors.estimates(state.data, best.fit).frame) / np.maximum(deviations(errors.frame), 1e-300)
    worst = int(np.argmax(apart))
    if apart[worst] <= REFUTED:
        return None
    what = f"{'turned about' if worst < 3 else 'shifted along'} {'xyzxyz'[worst]}"
    return (
        f"the frame of the tracks would be {what} by {apart[worst]:.3g} times its stated standard error; beyond "
        f"{REFUTED:g} the statement counts as wrong, and the frame as exact: align the tracks again, or leave "
        "frame_error out"
    )
