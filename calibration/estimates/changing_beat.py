"""Remarks on recordings during which the beat changes, which a periodic model does not explain."""

from __future__ import annotations

from collections.abc import Iterable

from wingfit.calibration.problem import compared
from wingfit.inference.noise.changes.drift import Drift
from wingfit.inference.noise.changes.modulation import Modulation, modulation_words
from wingfit.inference.noise.harmonic import changes_and_noise, whole_markers
from wingfit.records import Recording

LEAST = 0.1  # of the root mean square of the noise: smaller changes are not remarked


def changing_beat_remarks(recordings: Iterable[Recording], axes: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Return remarks on ``recordings`` in which the beat changes slowly, or differs periodically.

    ``axes``: force axes that are compared (:func:`wingfit.calibration.problem.compared`). Recordings with too few
    samples or beats to show a change are passed over.
    """
    found, modulated = [], []
    for recording in recordings:
        drift, modulation, noise = _seen(recording, axes)
        unit = "mN" if recording.kind == "forces" else "mm"
        if modulation is not None and modulation.size > LEAST * noise:
            modulated.append((repr(recording.name), modulation.words(f"{1e3 * modulation.size:.3g} {unit}")))
        if drift is not None and drift.size > LEAST * noise:
            found.append(f"{recording.name!r} ({drift.words(f'{1e3 * drift.size:.3g} {unit}')})")
    remark = (
        f"the beat changes slowly during {', '.join(found)}: something drifts (a stiffness, a motor, a clock, a "
        "camera), and a periodic model does not explain that; record when the rig has settled, or shorter"
    )
    return (*((remark,) if found else ()), *((modulation_words(modulated),) if modulated else ()))


def _seen(recording: Recording, axes: tuple[str, ...]) -> tuple[Drift | None, Modulation | None, float]:
    try:
        seen = compared(recording, axes) if recording.kind == "forces" else whole_markers(recording)
        return changes_and_noise(recording, seen)
    except ValueError:
        return None, None, 0.0
