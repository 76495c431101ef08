"""Random noise of trackers and balances with several spectra, which are not given to a diagnosis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

Colour = Literal["first_order", "wavy", "pink", "heavy", "shake"]
COLOURS: tuple[Colour, ...] = get_args(Colour)
_SETTLE = 400  # samples before the first, for the filter's transient
_TAILS = 5.0  # degrees of freedom of Student's t: a kurtosis of 9
_TURN, _MOVING_AVERAGE = 0.7, 0.4  # of wavy noise: angle of the poles in rad per sample, and the zero
_DEPTH = 1.5  # noise along z, away from the cameras, relative to that along x and y


@dataclass(frozen=True)
class Noise:
    """Settings of the noise of marker tracks.

    Attributes:
        colour: "first_order" autoregressive; "wavy" ARMA(2, 1), with a pair of complex poles; "pink", power inversely
            proportional to frequency; "heavy", first order with innovations from Student's t; "shake", first order,
            partly common to all markers because the cameras move.
        level: RMS over all coordinates, m.
        memory: modulus of the pole or poles, 0 to 0.9; not used by pink noise.
        common: fraction of the variance that all markers share, in "shake".
    """

    colour: Colour
    level: float
    memory: float = 0.5
    common: float = 0.5


def draw_noise(rng: np.random.Generator) -> Noise:
    """Settings of the noise drawn from ``rng``: any colour, RMS 0.2 to 0.8 mm."""
    colour = COLOURS[int(rng.integers(len(COLOURS)))]
    level, memory, common = rng.uniform([2e-4, 0.0, 0.3], [8e-4, 0.8, 0.7])
    return Noise(colour, float(level), float(memory), float(common))


def track_noise(noise: Noise, frames: int, markers: int, rng: np.random.Generator) -> Array:
    """Noise [frames, markers, 3] of marker positions, m, largest along z (depth) and of another RMS for each marker."""
    each = coloured(noise.colour, noise.memory, (frames, markers, 3), rng)
    if noise.colour == "shake":
        shared = coloured("first_order", noise.memory, (frames, 1, 3), rng)
        each = math.sqrt(noise.common) * shared + math.sqrt(1.0 - noise.common) * each
    spread = np.exp(0.2 * rng.standard_normal((1, markers, 1))) * np.array([1.0, 1.0, _DEPTH])
    return np.asarray(noise.level * each * spread / np.sqrt(np.mean(spread**2)))


def coloured(colour: Colour, memory: float, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Random array of ``shape``, correlated along its first axis (time), with expected variance one.

    ``memory``: modulus of the poles. For "shake", the result is only the part that differs between markers.
    """
    if colour == "pink":
        return _pink(shape, rng)
    longer = (shape[0] + _SETTLE, *shape[1:])
    if colour == "heavy":
        white = rng.standard_t(_TAILS, longer) * math.sqrt((_TAILS - 2.0) / _TAILS)
    else:
        white = rng.standard_normal(longer)
    if colour == "wavy":
        numerator, denominator = [1.0, _MOVING_AVERAGE], [1.0, -2.0 * memory * math.cos(_TURN), memory**2]
    else:
        numerator, denominator = [1.0], [1.0, -memory]
    echo = lfilter(numerator, denominator, np.eye(1, _SETTLE)[0])
    filtered = lfilter(numerator, denominator, white, axis=0)[_SETTLE:]
    return np.asarray(filtered / math.sqrt(float((echo**2).sum())))


def _pink(shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Noise of ``shape`` with power proportional to 1 / frequency along its first axis, and expected variance one.

    The power is constant below the frequency of one period in four times the length of the result.
    """
    longer = 4 * shape[0]
    k = np.arange(longer // 2 + 1)
    gain = 1.0 / np.sqrt(np.maximum(k, 1))
    power = gain**2 * np.where((k > 0) & (2 * k < longer), 2.0, 1.0)
    spectrum = np.fft.rfft(rng.standard_normal((longer, *shape[1:])), axis=0)
    spectrum *= (gain / math.sqrt(power.sum() / longer)).reshape(-1, *(1,) * (len(shape) - 1))
    start = int(rng.integers(longer - shape[0]))
    return np.asarray(np.fft.irfft(spectrum, longer, axis=0)[start : start + shape[0]])


def bursts(shape: tuple[int, int], rate: float, length: float, rng: np.random.Generator) -> Bools:
    """Mask [frames, markers], True within random bursts along the first axis.

    A burst begins at each frame with probability ``rate`` and lasts ``length`` frames on average.
    """
    starts = rng.uniform(size=shape) < rate
    lasting = rng.geometric(1.0 / length, shape)
    left = np.zeros(shape[1], int)
    out = np.zeros(shape, bool)
    for t in range(shape[0]):
        left = np.maximum(left - 1, np.where(starts[t], lasting[t], 0))
        out[t] = left > 0
    return out
