"""Misfits of a nominal and of a best genome to every recording of a rig, channel by channel and in total."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.calibration.problem import Evaluation, spans
from wingfit.calibration.series.result import ChannelMisfit, RelativeTo, SeriesMisfit
from wingfit.inference.noise.series import KnownNoise, known_noise
from wingfit.records import Series, SeriesDataset
from wingfit.records.array_types import Array


@dataclass(frozen=True)
class Compared:
    """One recording with the residuals of two genomes, the nominal and the best.

    Attributes:
        recording: with T samples of C channels.
        residuals: [2, T, C] simulated minus recorded, in the units of the channels; NaN where nothing was recorded.
        reasons: why the genomes cannot be simulated, None where they can.
        noise: what is known of the noise.
    """

    recording: Series
    residuals: Array
    reasons: tuple[str | None, ...]
    noise: KnownNoise

    @property
    def samples(self) -> Array:
        """Number [C] of recorded values."""
        return np.asarray(self.recording.valid.sum(axis=0))

    @property
    def noise_is_known(self) -> bool:
        """Whether the noise of all channels that were recorded is known."""
        return bool(np.isfinite(self.noise.standard_deviation[self.samples > 0]).all())

    def squares(self, which: int) -> Array:
        """Sum of squares [C] of the residuals of genome number ``which``, in squared units of the channels."""
        return np.asarray((np.where(self.recording.valid, self.residuals[which], 0.0) ** 2).sum(axis=0))

    def scale(self, relative_to: RelativeTo) -> Array:
        """What misfits are divided by [C], in the units of the channels."""
        return self.noise.standard_deviation if relative_to == "noise" else spans(self.recording)


def compared(dataset: SeriesDataset, both: Evaluation) -> tuple[Compared, ...]:
    """Pair each recording with its misfits in ``both``, the evaluation of the nominal and the best genome."""
    noises = known_noise(dataset.recordings)
    found = []
    for recording, part in zip(dataset.recordings, both.per_recording, strict=True):
        if part.residuals is None:
            raise TypeError("the evaluator returned no residuals although they were requested")
        found.append(Compared(recording, part.residuals, part.reasons, noises[recording.name]))
    return tuple(found)


def total(some: Sequence[Compared], which: int, relative_to: RelativeTo) -> float | None:
    """Return the relative misfit of genome number ``which`` to the recordings ``some``; None if it has none."""
    if not some or any(one.reasons[which] for one in some):
        return None
    squares = sum(float((one.squares(which) / one.scale(relative_to) ** 2)[one.samples > 0].sum()) for one in some)
    return float(np.sqrt(squares / sum(int(one.samples.sum()) for one in some)))


def misfit_of(one: Compared, *, fitted: bool, held_out: bool, relative_to: RelativeTo) -> SeriesMisfit:
    """Return the misfits to one recording."""
    rms: list[list[float | None]] = [
        [
            None if one.reasons[which] or not n else float(np.sqrt(s / n))
            for s, n in zip(one.squares(which), one.samples, strict=True)
        ]
        for which in (0, 1)
    ]
    noise = [float(value) if np.isfinite(value) else None for value in one.noise.standard_deviation]
    channels = tuple(
        ChannelMisfit(channel.name, channel.unit, int(one.samples[k]), rms[0][k], rms[1][k], noise[k])
        for k, channel in enumerate(one.recording.quantities)
    )
    before, after = (total([one], which, relative_to) for which in (0, 1))
    return SeriesMisfit(one.recording.name, fitted, held_out, before, after, channels)
