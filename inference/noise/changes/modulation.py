"""Beats that differ periodically, such as odd and even ones: found against the noise, and kept apart from it.

A gear with another number of teeth, a motor that hunts, or a wake that repeats every two or three beats modulates the
beat at a rate of its own, a fraction of the flap frequency. Then there are spectral lines at that distance on both
sides of every harmonic; of odd and even beats that differ they lie half-way between the harmonics. The power of these
lines together is compared with that of the nearest lines, as the power of a slow change is
(:mod:`wingfit.inference.noise.changes.drift`). The rate is the one at which the lines stand out most.

Beats that scatter in size are modulated by chance, in all lines and channels at once: so few beats show a modulation
only if it is far above the scatter. A single line, such as the hum of the mains, is no modulation of the beat: it must
be seen without the strongest of its lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wingfit.inference.noise.changes.change_powers import ChangePowers, compared, envelopes
from wingfit.inference.noise.changes.drift import slow_basis
from wingfit.inference.noise.changes.slow_change import Change, orthonormal
from wingfit.inference.noise.mean_beat import fourier_basis, masks_of
from wingfit.records import Recording
from wingfit.records.array_types import Array, Bool, Float, Index, Int, Mask

HIGHEST = 3  # harmonic whose lines are used: a wing moves most in the first ones
STRONG = 0.05  # least power of such a harmonic, over that of the strongest: its lines are as much weaker
FEWEST_BEATS = 4  # with which lines of noise lie between a harmonic and the middle
FEWEST_OF_RATES = 6  # the same for a rate that is sought
SLOWEST = 2.0  # spectral lines: a slower modulation is a drift
BESIDE_ODD = 1.5  # spectral lines between a rate that is sought and that of odd and even beats
FINENESS = 8  # rates tried in a spectral line
NEAREST = 6  # spectral lines on either side with which the power is compared
FARTHEST = 0.3  # distance of these (flap frequencies): farther ones are near a harmonic, where a drift has its power
CERTAIN = 1e-4  # probability of noise alone below which beats count as modulated
BY_SIZE = 3e-3  # the same for beats that scatter in size
HARMONICS = {"tracks": 12, "forces": 24}  # of a steady beat that may appear at a line
APART = 1.5  # spectral lines between a line and such a harmonic, at least
AROUND = 9  # spectral lines whose median is the noise at a line, where the rate is sought
LONGEST = 8  # samples in the time of a recording, per sample that it has: with longer gaps no rate is sought
ODD = 0.5  # rate of odd and even beats that differ


@dataclass(frozen=True)
class Modulation:
    """A periodic ``change`` of the beat, and its ``rate`` in flap frequencies."""

    change: Change
    rate: float

    @property
    def found(self) -> bool:
        """Whether noise alone does not explain it."""
        return self.change.found

    @property
    def size(self) -> float:
        """Root mean square beyond the noise, over all samples and channels, m or N; 0 if it was not found."""
        return self.change.size if self.found else 0.0

    def words(self, size: str) -> str:
        """Describe it, with its ``size`` as text with its unit."""
        beats = 1.0 / self.rate
        whole = abs(beats - round(beats)) < 0.05 * beats
        every = f"every {round(beats)} beats" if whole else f"at {self.rate:.2g} of the flap frequency"
        return f"{every}, by {size}, {self.change.ratio:.2g} times the power of noise"


@dataclass(frozen=True)
class Sampled:
    """Samples of a recording: its ``kind``, its times in beats and samples, and the harmonics of its mean beat.

    ``psi`` [T]: phase (rad) of the beat; ``apparent`` [T]: time in apparent beats; ``number`` [T]: index of each sample
    in the regular sequence of samples; ``step``: beats between two of these; ``beats``: whole apparent beats;
    ``power``: of each of the first harmonics of the mean beat.
    """

    kind: str
    psi: Float[Array, " T"]
    apparent: Float[Array, " T"]
    number: Int[Index, " T"]
    step: float
    harmonics: int
    beats: int
    power: Float[Array, " K"]

    @classmethod
    def of(
        cls,
        recording: Recording,
        mean: Float[Array, "T C"],
        apparent: Float[Array, " T"],
        number: Int[Index, " T"],
        harmonics: int,
        beats: int,
    ) -> Sampled:
        """Return the samples of ``recording``, whose ``mean`` beat [T, C] is zero where samples are not used."""
        frequency = recording.condition.flap_frequency
        psi, step = 2 * np.pi * frequency * recording.times, float(np.median(np.diff(recording.times))) * frequency
        waves = np.exp(-1j * psi[:, None] * np.arange(1, min(HIGHEST, harmonics) + 1))
        scale = np.maximum(np.abs(mean).max(axis=0), 1e-300)
        power = (np.abs(waves.T @ (mean / scale)) ** 2).mean(axis=1)
        return cls(recording.kind, psi, apparent, number, step, harmonics, beats, power)

    def orders(self, rate: float) -> tuple[float, ...]:
        """Return the orders (flap frequencies) of the lines of a modulation at ``rate`` that a steady beat leaves free.

        Under a strobe, or with few samples in a beat, higher harmonics may appear at such a line.
        """
        strong = 1 + np.flatnonzero(self.power >= STRONG * self.power.max())
        lines = np.unique(np.concatenate([strong - rate, strong + rate]))
        steady = _folded(np.arange(1, HARMONICS[self.kind] + 1) * self.step)
        away = np.abs(steady[:, None] - _folded(lines * self.step)).min(axis=0)
        return tuple(lines[away > APART / (self.number[-1] + 1)].tolist())

    def all_orders(self, rate: float) -> tuple[float, ...]:
        """Return the orders of all lines of a modulation at ``rate`` near the first harmonics, weak ones too."""
        harmonics = np.arange(HIGHEST + 2)
        return tuple(np.unique(np.abs(np.concatenate([harmonics - rate, harmonics + rate]))).tolist())

    def appearing(self, orders: Sequence[float]) -> Float[Array, " L"]:
        """Return where lines of these ``orders`` appear, in cycles a sample, 0 to 1/2."""
        return _folded(np.array(orders) * self.step)

    def waves(self, orders: Sequence[float]) -> Float[Array, "T P"]:
        """Return the waves of these ``orders``, a cosine and a sine each, as columns [T, P]."""
        angles = self.psi[:, None] * np.repeat(orders, 2)
        return np.asarray(np.where(np.arange(angles.shape[1]) % 2 == 0, np.cos(angles), np.sin(angles)))


def modulation_of(
    scatter: Float[Array, "T C"], valid: Bool[Mask, "T C"], sampled: Sampled, least: float = 0.0
) -> Modulation | None:
    """Compare a periodic change of the beat with the noise near its lines.

    ``scatter`` [T, C]: recorded values minus mean beat, zero where not ``valid``; ``least`` (m or N): a change of
    smaller root mean square counts as none. None with too few beats, fewer than two lines, or too few samples.
    """
    if sampled.beats < FEWEST_BEATS:
        return None
    parts = list(_Part.of(scatter, valid, sampled))
    rates, found = (ODD, *_standing_out(parts, sampled)), []
    for rate in rates:
        change = _change(parts, sampled, rate, int(valid.sum()))
        if change is not None:
            seen = change if change.size >= least else replace(change, probability=1.0)
            found.append(Modulation(seen, rate))
    return min(found, key=lambda one: one.change.probability) if found else None


@dataclass(frozen=True)
class _Part:
    """Values [N, C] of channels with the same gaps, without slow changes, and the ``known`` waves [N, P] in them."""

    mask: Mask
    channels: Index
    known: Array
    values: Array

    @property
    def level(self) -> Array:
        """Mean square [C] of the values."""
        return np.asarray(np.maximum((self.values**2).mean(axis=0), 1e-300))

    @classmethod
    def of(cls, scatter: Array, valid: Mask, sampled: Sampled) -> list[_Part]:
        slow, _ = slow_basis(sampled.psi, sampled.apparent, sampled.beats, sampled.harmonics)
        known = np.hstack([fourier_basis(sampled.psi, sampled.harmonics), slow])
        parts = []
        for mask, channels in masks_of(valid):
            if mask.any():
                basis, values = orthonormal(known[mask]), scatter[np.ix_(mask, channels)]
                parts.append(cls(mask, channels, basis, values - basis @ (basis.T @ values)))
        return parts


def _standing_out(parts: list[_Part], sampled: Sampled) -> tuple[float, ...]:
    """Return the rate at which lines stand out most from the noise around them, the strongest not counted; or none."""
    length = int(sampled.number[-1]) + 1
    if sampled.beats < FEWEST_OF_RATES or length > LONGEST * len(sampled.number):
        return ()
    from scipy.ndimage import median_filter

    power = np.zeros(FINENESS * length // 2 + 1)
    for part in parts:
        for values in (part.values / np.sqrt(part.level)).T:
            grid = np.zeros(length)
            grid[sampled.number[part.mask]] = values
            power += np.abs(np.fft.rfft(grid, FINENESS * length)) ** 2
    power /= np.maximum(median_filter(power, size=FINENESS * AROUND), 1e-9 * power.max(initial=1e-300))
    least, most = SLOWEST * FINENESS, (ODD * sampled.beats - BESIDE_ODD) * FINENESS
    rates = np.arange(least, most + 1.0) / (FINENESS * sampled.beats)
    best, score = 0.0, 0.0
    for rate in rates.tolist():
        at = power[np.round(sampled.appearing(sampled.orders(rate)) * FINENESS * length).astype(int)]
        if len(at) > 1 and at.sum() - at.max() > score:
            best, score = rate, float(at.sum() - at.max())
    if not score:
        return ()
    # Lines of a wrong rate leave part of the change in the noise: the best rate beside it explains most.
    near = rates[np.abs(rates - best) * sampled.beats <= 1.0].tolist()
    return (max(near, key=lambda rate: _explained(parts, sampled, rate)),)


def _explained(parts: list[_Part], sampled: Sampled, rate: float) -> float:
    """Return the part of the power that lines of a modulation at ``rate`` explain, summed over the channels."""
    total = 0.0
    for part in parts:
        basis = orthonormal(sampled.waves(sampled.all_orders(rate))[part.mask], part.known)
        total += float((((basis.T @ part.values) ** 2).sum(axis=0) / part.level).sum())
    return total


def _change(parts: list[_Part], sampled: Sampled, rate: float, samples: int) -> Change | None:
    """Return the change at ``rate``; None for fewer than two lines, or too few samples between gaps."""
    orders = sampled.orders(rate)
    if len(orders) < 2:
        return None
    distances = np.arange(1, min(NEAREST, int(FARTHEST * sampled.beats)) + 1) / sampled.beats
    powers = []
    for part in parts:
        psi, apparent = sampled.psi[part.mask], sampled.apparent[part.mask]
        waves = sampled.waves(orders)[part.mask]
        lines = [orthonormal(waves[:, 2 * k : 2 * k + 2], part.known) for k in range(len(orders))]
        every = orthonormal(sampled.waves(sampled.all_orders(rate))[part.mask], part.known)
        around = [orthonormal(envelopes(psi, apparent, k, distances), part.known, every) for k in orders]
        steady = part.values - every @ (every.T @ part.values)
        powers.append(ChangePowers.of(part.values, steady, [lines], around, every[:, :0]))
    if not powers or min(float(one.freedom.min()) for one in powers) < 1.0:
        return None
    found, rest = compared(powers, samples), compared(_without_strongest(powers), samples)
    # The sizes of beats have one coefficient at the rate of odd and even ones, and two at another. Of their number,
    # these, the mean and slow changes are no noise.
    own, tried = (1.0, 1.0) if rate == ODD else (2.0, float(sampled.beats))
    by_size = compared(powers, samples, (own, min(2.0 * len(distances) * own, max(sampled.beats - 3.0 - own, 1.0))))
    probability = max(found.probability, rest.probability, by_size.probability * CERTAIN / BY_SIZE)
    return replace(found, probability=min(tried * probability, 1.0), certain=CERTAIN)


def modulation_words(found: Sequence[tuple[str, str]]) -> str:
    """Return a remark on recordings whose beats differ periodically: the name of each, and how."""
    where = ", ".join(f"{name} ({how})" for name, how in found)
    return (
        f"beats differ periodically in {where}: something repeats more slowly than the beat (odd and even beats that "
        "differ, a gear, a motor that hunts, a wake; or a flap frequency that is stated too high), which a model with "
        "one beat does not explain; check the stated frequency and the drive"
    )


def _folded(cycles: npt.ArrayLike) -> Array:
    """Frequency, in cycles a sample, at which ``cycles`` a sample appear: 0 to 1/2."""
    every = np.asarray(cycles, float)
    return np.asarray(np.abs(every - np.round(every)))


def _without_strongest(parts: list[ChangePowers]) -> list[ChangePowers]:
    power = sum((one.change[0] / one.level).sum(axis=-1) for one in parts)
    strongest = int(np.argmax(power))
    return [one.of_harmonics([k for k in range(len(one.near)) if k != strongest]) for one in parts]
