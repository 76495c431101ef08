"""Zero-phase low-pass filter for recordings and for predictions (Armanini et al. 2016, section 3.4).

The filter is a Butterworth filter that runs forwards and backwards in time, so that it shifts no phase.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from wingfit.records import LowPass, Recording
from wingfit.records.array_types import Array, ArrayLike
from wingfit.records.limits import UNEVEN_STEPS

CUTOFF_HARMONIC = 3.2  # 40 Hz at 12.5 beats per second (Armanini et al. 2016): just above the third harmonic
END_PERIODS = 2.0  # length of the filter's transient at either end, in periods of the cut-off frequency
MIN_BEATS_TO_TRIM = 8
BEAT_BANDWIDTH, MOST_OF_RATE = 4.0, 0.4  # highest frequency of the mean beat, over cut-off and sampling rate


def default_cutoff(flap_frequency: float) -> float:
    """Cut-off frequency (Hz) just above the third harmonic of ``flap_frequency`` (Hz)."""
    return CUTOFF_HARMONIC * flap_frequency


def sampling_rate(recording: Recording) -> float:
    """Samples per second of ``recording``; ValueError if the sampling intervals are not equal."""
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
    """Return ``recording`` filtered by ``low_pass``.

    ValueError if values are missing, if sampling intervals are not equal, or if the recording is filtered already. Near
    both ends the filtered values have large errors. They are replaced by NaN, for END_PERIODS periods of the cut-off
    frequency but at most one beat, unless the recording has fewer than MIN_BEATS_TO_TRIM beats. The standard deviation
    of the noise, where it is stated, becomes that of white noise after the filter.
    """
    if recording.low_pass is not None:
        raise ValueError(
            f"recording {recording.name!r} has been low-passed at {recording.low_pass.cutoff:g} Hz already; "
            "filter the raw recording instead, or calibrate without another filter"
        )
    gaps = int(np.count_nonzero(~recording.valid))
    if gaps:
        raise ValueError(
            f"recording {recording.name!r} has {gaps} missing values, but a filter needs all; "
            "fill the gaps, cut the recording, or calibrate without one (low-pass 0: --low-pass-hz 0)"
        )
    values = Filter.of(recording, low_pass)(recording.values)
    rate, noise = sampling_rate(recording), recording.standard_deviation
    if noise is not None:
        noise = noise * np.sqrt(np.mean(gain(low_pass, rate, np.linspace(0.0, 0.5, 4096, endpoint=False) * rate) ** 2))
    return replace(recording, values=values, low_pass=low_pass, standard_deviation=noise)


@dataclass(frozen=True, eq=False)
class Filter:
    """A low-pass for whatever is sampled at the T instants of one recording.

    The mean beat is filtered exactly, up to both ends; only the rest, which is small, has a transient there.

    Attributes:
        sections: of the Butterworth filter, in second order.
        pad: samples by which the rest is continued at either end.
        lost: samples at either end that become NaN.
        waves: mean, cosines and sines of the harmonics of the mean beat [T, R].
        kept: gain at each of these [R].
    """

    sections: Array
    pad: int
    lost: int
    waves: Array
    kept: Array

    @classmethod
    def of(cls, recording: Recording, low_pass: LowPass) -> Filter:
        """Prepare ``low_pass`` for ``recording``; ValueError as in :func:`low_passed`, but for missing values."""
        rate, frequency, count = sampling_rate(recording), recording.condition.flap_frequency, len(recording.times)
        sections = _sections(low_pass, rate, f"recording {recording.name!r}")
        # The padding must be longer than the impulse response of the filter.
        pad = min(count - 1, int(3 * low_pass.order * rate / low_pass.cutoff))
        trimmed = count * frequency >= MIN_BEATS_TO_TRIM * rate
        lost = round(min(END_PERIODS / low_pass.cutoff, 1.0 / frequency) * rate) if trimmed else 0
        k = np.arange(beat_harmonics(recording, low_pass) + 1)
        phase = 2.0 * np.pi * frequency * (recording.times - recording.times[0])
        waves = np.exp(1j * phase[:, None] * k)
        kept = gain(low_pass, rate, k * frequency)
        columns = np.hstack([waves.real, waves[:, 1:].imag])
        return cls(sections, pad, lost, columns, np.concatenate([kept, kept[1:]]))

    def __call__(self, values: Array) -> Array:
        """Return ``values`` [T, C] filtered."""
        mean = np.linalg.lstsq(self.waves, values, rcond=None)[0]
        rest = scipy.signal.sosfiltfilt(self.sections, values - self.waves @ mean, axis=0, padlen=self.pad)
        passed = np.ascontiguousarray(self.waves @ (self.kept[:, None] * mean) + rest)
        passed[: self.lost] = passed[len(passed) - self.lost :] = np.nan
        return passed


def beat_harmonics(recording: Recording, low_pass: LowPass) -> int:
    """Number of harmonics of the flap frequency in the mean beat of ``recording`` that ``low_pass`` filters."""
    most = min(BEAT_BANDWIDTH * low_pass.cutoff, MOST_OF_RATE * sampling_rate(recording))
    return max(int(most / recording.condition.flap_frequency), 1)


def gain(low_pass: LowPass, rate: float, frequency: ArrayLike) -> Array:
    """Real gain (the filter shifts no phase) of ``low_pass`` at ``frequency`` (Hz) for samples taken at ``rate`` (Hz).

    0 from half the rate on: samples cannot represent such frequencies, so that harmonics of a model there would appear
    at wrong frequencies (aliases).
    """
    f = np.asarray(frequency, float)
    response = scipy.signal.sosfreqz(
        _sections(low_pass, rate, "the recording"), worN=np.minimum(f, 0.5 * rate), fs=rate
    )[1]
    return np.where(f < 0.5 * rate, np.abs(response) ** 2, 0.0)


def _sections(low_pass: LowPass, rate: float, what: str) -> Array:
    if not 0 < low_pass.cutoff < 0.5 * rate:
        raise ValueError(
            f"a low-pass at {low_pass.cutoff:g} Hz does not fit {what}, sampled at {rate:g} Hz; "
            f"the cutoff must lie in (0, {0.5 * rate:g}) Hz"
        )
    return np.asarray(scipy.signal.butter(low_pass.order, low_pass.cutoff, fs=rate, output="sos"))
