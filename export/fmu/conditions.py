"""The condition of an FMU: fixed pressure, temperature and gravity, where inputs start, and the steps of time."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.fmu.memory import Memory
from wingfit.export.fmu.variables import INPUTS, Limit, Variable
from wingfit.records import Condition, Wing
from wingfit.records.array_types import Array
from wingfit.sim.solver.numerics import LADDER
from wingfit.sim.solver.simulate import periodic_beats
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.loads import LOAD_ACCURACY

_FIXED = ("pressure", "temperature", "gravity")


def reference_condition(model: CalibratedModel) -> Condition:
    """Return the mean condition of the fitted recordings with the commonest pressure, temperature and gravity.

    Of pressures that are equally common it is the highest, since a model is mostly wanted in air.
    """
    fitted = [one.condition for one in model.recordings if one.condition is not None]
    counts = Counter(tuple(getattr(one, name) for name in _FIXED) for one in fitted)
    most = max(counts, key=lambda fixed: (counts[fixed], fixed))
    alike = [one for one in fitted if tuple(getattr(one, name) for name in _FIXED) == most]
    means = {name: sum(getattr(one, name) for one in alike) / len(alike) for name in INPUTS}
    return replace(alike[0], **means)


def inputs_of(
    model: CalibratedModel, start: Condition, memory: Memory, board: Array
) -> tuple[list[Variable], list[Limit]]:
    """Return the inputs and their fitted ranges, and set their starts on the ``board``."""
    first, variables, limits = memory.word(board.ctypes.data), list[Variable](), list[Limit]()
    for name, (place, unit, text, least, most) in INPUTS.items():
        if name == "phase_lag" and not isinstance(model.rig, Wing):
            continue
        value = getattr(start, name)
        board[place] = value
        variables.append(Variable(name, first + place, "input", unit, text, value, least, most))
        limits.append(Limit(name, first + place, unit, *fitted_range(model, start, name)))
    return variables, limits


def parameters_of(memory: Memory, board: Array, *parameters: Variable) -> list[Variable]:
    """Return the ``parameters`` at their words of the memory, and set their starts on the ``board``."""
    first = memory.word(board.ctypes.data)
    for one in parameters:
        board[one.word] = one.start
    return [replace(one, word=first + one.word) for one in parameters]


def fitted_range(model: CalibratedModel, start: Condition, name: str) -> tuple[float, float]:
    """Return the fitted range of the input ``name``, which contains its start."""
    value = float(getattr(start, name))
    known = next((one for one in model.ranges if one.name == name), None)
    return (min(known.low, value), max(known.high, value)) if known else (value, value)


def steps_for(model: CalibratedModel) -> int:
    """Return the steps of time per beat at which loads are accurate, at the lowest and the highest fitted frequency.

    It is 1 for a vehicle, whose forces need none, and the largest number for a wing that does not become periodic.
    """
    wing = model.simulation() if model.kind == "tracks" else None
    if not isinstance(wing, FlexibleWing) or wing.wing.structure == "rigid":
        return 1
    fitted = [one.condition for one in model.recordings if one.condition is not None]
    ends = {min(fitted, key=lambda one: one.flap_frequency), max(fitted, key=lambda one: one.flap_frequency)}
    fine = replace(wing, numerics=replace(wing.numerics, accuracy=min(LOAD_ACCURACY, wing.numerics.accuracy)))
    needed = []
    for condition in ends:
        genome = np.array(model.genome(condition))
        subject = fine.subject(fine._switched_on(genome), condition)
        (beat,) = periodic_beats(subject, genome[None], fine.numerics)
        needed.append(len(beat.tracks) if beat.reason is None else LADDER[-1])
    return max(needed)
