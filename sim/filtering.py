"""Zero-phase low-pass, alike for what was recorded and what a model predicts (Armanini et al. 2016, section 3.4)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.signal import butter, sosfiltfilt, sosfreqz

from wingfit.records import LowPass, Recording
from wingfit.records.array_types import Array, ArrayLike
from wingfit.records.limits import UNEVEN_STEPS

CUTOFF_HARMONIC = 3.2  # the seed's 40 Hz at 12.5 beats per second: just above the third harmonic
ENDS = 2.0  # periods of the cutoff that a filter needs to settle, at either end
FEW_BEATS = 4


def default_cutoff(flap_frequency: float) -> float:
    """Cutoff (Hz) just above the third harmonic, as the seed's 40 Hz is."""
    return CUTOFF_HARMONIC * flap_frequency


def sampling_rate(recording: Recording) -> float:
    """Samples per second; ValueError where the sampling is not even."""
    steps = np.diff(recording.times)
    mean = float(steps.mean())
    worst = float(np.abs(steps - mean).max())
    if worst > UNEVEN_STEPS * mean:
        raise ValueError(
            f"recording {recording.name!r} is not sampled evenly: steps differ by up to {worst * 1e3:.3g} ms from "
            f"their mean of {mean * 1e3:.4g} ms (limit {100 * UNEVEN_STEPS:g} %); resample it, or calibrate "
            "without a low-pass"
        )
    return 1.0 / mean


def low_passed(recording: Recording, low_pass: LowPass) -> Recording:
    """``recording`` filtered forwards and backwards; ValueError for gaps, uneven steps, or a filter before this one.

    What lies outside the recording is not known to the filter: the values near both ends would be wrong by a good part
    of the force, and are missing (NaN) instead, for ENDS periods of the cutoff or one beat. A recording of fewer than
    FEW_BEATS beats has nothing to spare and keeps them.
    """
    if recording.low_pass is not None:
        raise ValueError(
            f"recording {recording.name!r} has been low-passed at {recording.low_pass.cutoff:g} Hz already; "
            "filter the raw recording instead, or calibrate without another filter"
        )
    gaps = int(np.count_nonzero(~recording.valid))
    if gaps:
        raise ValueError(
            f"recording {recording.name!r} lacks {gaps} values, and a filter needs all; "
            "fill the gaps, cut the recording, or calibrate without low-pass filter"
        )
    sections = _sections(low_pass, sampling_rate(recording), f"recording {recording.name!r}")
    # The pad must outlast the filter's memory, of the order of its cutoff's period.
    pad = min(len(recording.times) - 1, int(3 * low_pass.order * sampling_rate(recording) / low_pass.cutoff))
    values = np.ascontiguousarray(sosfiltfilt(sections, recording.values, axis=0, padlen=pad))
    frequency, rate = recording.condition.flap_frequency, sampling_rate(recording)
    if len(values) * frequency >= FEW_BEATS * rate:
        lost = round(min(ENDS / low_pass.cutoff, 1.0 / frequency) * rate)
        values[:lost] = values[len(values) - lost :] = np.nan
    return replace(recording, values=values, low_pass=low_pass)


def gain(low_pass: LowPass, rate: float, frequency: ArrayLike) -> Array:
    """Gain (real: no phase) at ``frequency`` (Hz) of the filter as it works on samples taken at ``rate`` (Hz).

    Above half the rate there is nothing to filter: a model's harmonics there would be aliases, and get none.
    """
    f = np.asarray(frequency, float)
    response = sosfreqz(_sections(low_pass, rate, "the recording"), worN=np.minimum(f, 0.5 * rate), fs=rate)[1]
    return np.where(f < 0.5 * rate, np.abs(response) ** 2, 0.0)


def _sections(low_pass: LowPass, rate: float, what: str) -> Array:
    if not 0 < low_pass.cutoff < 0.5 * rate:
        raise ValueError(
            f"a low-pass at {low_pass.cutoff:g} Hz does not fit {what}, sampled at {rate:g} Hz; "
            f"the cutoff must lie in (0, {0.5 * rate:g}) Hz"
        )
    return np.asarray(butter(low_pass.order, low_pass.cutoff, fs=rate, output="sos"))
