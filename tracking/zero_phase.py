"""Smoothing and differentiation in one step: convolution kernels of a zero-phase Butterworth filter.

The filter is that of :class:`wingfit.records.LowPass`, a digital Butterworth low-pass run forwards and backwards. The
derivatives are those of the filtered signal, exact in the frequency domain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from wingfit.records import LowPass
from wingfit.records.array_types import Array

_LENGTH = 8192
_TAIL = 1e-4


@dataclass(frozen=True, eq=False)
class Kernels:
    """Weights of 2 n + 1 samples: row d of ``taps`` [3, 2 n + 1] gives the d-th derivative (per s^d), filtered.

    ``taps[d] @ x[i - n : i + n + 1]`` is the derivative of the filtered signal x at sample i.
    """

    taps: Array

    @property
    def reach(self) -> int:
        """Half the width n of the windows: number of samples without a result at each end and on each side of a gap."""
        return int(self.taps.shape[1]) // 2

    def apply(self, values: Array, derivative: int) -> Array:
        """Derivative (order 0 to 2, per s^d) by time of the filtered ``values`` [T, ...].

        NaN within ``reach`` samples of an end or of a missing sample.
        """
        n = self.reach
        result = np.full(values.shape, np.nan)
        if len(values) > 2 * n:
            windows = np.lib.stride_tricks.sliding_window_view(values, 2 * n + 1, axis=0)
            result[n:-n] = windows @ self.taps[derivative]
        return result


def kernels(low_pass: LowPass, rate: float) -> Kernels:
    """Kernels of ``low_pass`` for samples at ``rate`` Hz; ValueError unless the cut-off is in (0, 0.45 ``rate``].

    They are truncated where all have decreased to 1e-4 of their largest value, then corrected by the least change (in
    least squares) that makes them exact for cubic polynomials.
    """
    if not 0 < low_pass.cutoff <= 0.45 * rate:
        rule = f"with samples at {rate:g} Hz it must be above 0 and at most {0.45 * rate:g} Hz"
        raise ValueError(f"cut-off {low_pass.cutoff:g} Hz; {rule}: choose a lower cut-off or record faster")
    frequency = np.fft.rfftfreq(_LENGTH, 1 / rate)
    sections = scipy.signal.butter(low_pass.order, low_pass.cutoff, fs=rate, output="sos")
    gain = np.abs(scipy.signal.sosfreqz(sections, frequency, fs=rate)[1]) ** 2
    full = np.stack([np.fft.irfft(gain * (2j * np.pi * frequency) ** d, _LENGTH) for d in range(3)])
    full = np.fft.fftshift(full[:, (-np.arange(_LENGTH)) % _LENGTH], axes=1)  # as weights of x[i + j]
    middle = _LENGTH // 2
    beyond = np.abs(full[:, middle:]) > _TAIL * np.abs(full).max(axis=1, keepdims=True)
    n = int(np.max(np.nonzero(beyond)[1]))
    taps = full[:, middle - n : middle + n + 1]
    powers = np.vander(np.arange(-n, n + 1) / rate, 4, increasing=True)
    wanted = np.diag([1.0, 1.0, 2.0])  # d-th derivative of t^k at 0
    target = np.hstack([wanted, np.zeros((3, 1))])
    return Kernels(taps + np.linalg.lstsq(powers.T, (target - taps @ powers).T, rcond=None)[0].T)
