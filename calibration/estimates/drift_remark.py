"""A remark on recordings during which the beat changes slowly, which a periodic model does not explain."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from wingfit.calibration.problem import compared
from wingfit.inference.noise.harmonic import HarmonicFit, harmonic_fit, whole_markers
from wingfit.records import Recording

LEAST = 0.1  # of the root mean square of the noise: smaller changes are not remarked
ROUND_OFF = 1e-6  # of the largest value, the same for recordings without noise


def drift_remark(recordings: Iterable[Recording], axes: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Return a remark on ``recordings`` during which the beat changes slowly; empty if there are none.

    ``axes``: force axes that are compared (:func:`wingfit.calibration.problem.compared`). Recordings with too few
    samples or beats to show a change are passed over.
    """
    found = []
    for recording in recordings:
        fit = _fit(recording, axes)
        if fit is None or fit.drift is None or not fit.drift.found:
            continue
        noise = float(np.sqrt(np.mean(fit.noise[fit.used] ** 2)))
        if fit.drift.size > max(LEAST * noise, ROUND_OFF * float(np.nanmax(np.abs(recording.values)))):
            unit = "mN" if recording.kind == "forces" else "mm"
            size = f"{1e3 * fit.drift.size:.3g} {unit}"
            found.append(f"{recording.name!r} (by {size}, {fit.drift.ratio:.2g} times the power of noise)")
    remark = (
        f"the beat changes slowly during {', '.join(found)}: something drifts (a stiffness, a motor, a clock, a "
        "camera), and a periodic model does not explain that; record when the rig has settled, or shorter"
    )
    return (remark,) if found else ()


def _fit(recording: Recording, axes: tuple[str, ...]) -> HarmonicFit | None:
    try:
        seen = compared(recording, axes) if recording.kind == "forces" else whole_markers(recording)
        return harmonic_fit(recording, seen)
    except ValueError:
        return None
