"""Loads of a wing under a condition, from a simulation that is accurate enough for loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wingfit.records import Recording
from wingfit.records.array_types import Array
from wingfit.records.blas_threads import one_blas_thread
from wingfit.sim.model import Solution
from wingfit.sim.solver.numerics import LADDER
from wingfit.sim.solver.simulate import Beat
from wingfit.sim.wing.alignment import REFERENCE_HARMONICS, reference_columns, upstroke_crossing
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.load_recovery import from_motion
from wingfit.sim.wing.outputs import Outputs

LOAD_ACCURACY = 1e-5  # m, of the tracks that loads are computed from
CLOSING = 0.01  # largest error of the energy balance, relative to the energy supplied in a beat


@one_blas_thread
def simulate_outputs(model: FlexibleWing, genome: Sequence[float], recording: Recording) -> Outputs:
    """Simulate ``genome`` [G] under the recording's condition and return its loads.

    The number of steps per beat is increased until the error of the beat's energy balance is at most CLOSING, relative
    to the energy supplied, unless the number is given in ``model.numerics``. ValueError with the reason if the
    simulation fails.
    """
    if model.wing.structure == "rigid":
        raise ValueError("the loads of a rigid wing are not computed; describe it as a stiff sheet: structure: sheet")
    beat = _fine(model).beat(genome, recording, with_motion=True)
    if beat.reason is not None:  # perhaps with the accuracy that tracks need
        beat = model.beat(genome, recording, with_motion=True)
    if beat.reason is not None:
        raise ValueError(f"the wing cannot be simulated under {recording.name!r}: {beat.reason}")
    found = _outputs(model, genome, recording, beat)
    for steps in (n for n in LADDER if n > len(beat.tracks) and model.numerics.steps is None):
        if abs(found.balance.relative_closing) <= CLOSING:
            break
        finer = replace(model, numerics=replace(model.numerics, steps=steps, periodic=0.25 * LOAD_ACCURACY))
        closer = finer.beat(genome, recording, with_motion=True)
        if closer.reason is not None:
            break
        found = _outputs(model, genome, recording, replace(closer, error=beat.error))
    return found


def _outputs(model: FlexibleWing, genome: Sequence[float], recording: Recording, beat: Beat) -> Outputs:
    if beat.motion is None:
        raise AssertionError("a beat without its motion")
    scene = model.scene(genome, recording.condition)
    found = from_motion(scene, beat.motion, crossing(model, recording, beat.tracks))
    return replace(found, solution=Solution(len(beat.tracks), beat.beats, beat.error))


def _fine(model: FlexibleWing) -> FlexibleWing:
    """Return the model with an accuracy of at least LOAD_ACCURACY, unless its number of steps is given.

    Loads are small displacements times large stiffnesses, and losses are small compared to the energy exchanged in a
    beat: both need a higher accuracy than tracks.
    """
    if model.numerics.steps is not None:
        return model
    accuracy = min(LOAD_ACCURACY, model.numerics.accuracy)
    return replace(model, numerics=replace(model.numerics, accuracy=accuracy))


def crossing(model: FlexibleWing, recording: Recording, tracks: Array) -> float:
    """Drive phase (beats) at which simulated ``tracks`` [n, M, 3] rise through the hinge height; 0 if they never do.

    The height is the mean of the reference markers that are used for ``recording``, so that both phases agree; of all
    reference markers if the recording has too few data.
    """
    names = [marker.name for marker in model.wing.markers]
    try:
        references: Sequence[str] = [recording.markers[c] for c in reference_columns(model.wing, recording)]
    except ValueError:
        references = model.wing.reference_markers
    height = tracks[:, [names.index(name) for name in references], 2].mean(axis=1)
    spectrum = np.fft.rfft(height)[: REFERENCE_HARMONICS + 1] / len(height)
    spectrum[1:] *= 2
    found = upstroke_crossing(spectrum[None], model.wing.hinge.z)[0] / (2 * np.pi)
    return float(found % 1.0) if np.isfinite(found) else 0.0
