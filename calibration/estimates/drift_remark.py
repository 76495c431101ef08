"""A remark on recordings during which the beat changes slowly, which a periodic model does not explain."""

from __future__ import annotations

from collections.abc import Iterable

from wingfit.calibration.problem import compared
from wingfit.inference.noise.drift import Drift
from wingfit.inference.noise.harmonic import drift_and_noise, whole_markers
from wingfit.records import Recording

LEAST = 0.1  # of the root mean square of the noise: smaller changes are not remarked


def drift_remark(recordings: Iterable[Recording], axes: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Return a remark on ``recordings`` during which the beat changes slowly; empty if there are none.

    ``axes``: force axes that are compared (:func:`wingfit.calibration.problem.compared`). Recordings with too few
    samples or beats to show a change are passed over.
    """
    found = []
    for recording in recordings:
        drift, noise = _seen(recording, axes)
        if drift is not None and drift.size > LEAST * noise:
            unit = "mN" if recording.kind == "forces" else "mm"
            found.append(f"{recording.name!r} ({drift.words(f'{1e3 * drift.size:.3g} {unit}')})")
    remark = (
        f"the beat changes slowly during {', '.join(found)}: something drifts (a stiffness, a motor, a clock, a "
        "camera), and a periodic model does not explain that; record when the rig has settled, or shorter"
    )
    return (remark,) if found else ()


def _seen(recording: Recording, axes: tuple[str, ...]) -> tuple[Drift | None, float]:
    try:
        seen = compared(recording, axes) if recording.kind == "forces" else whole_markers(recording)
        return drift_and_noise(recording, seen)
    except ValueError:
        return None, 0.0
