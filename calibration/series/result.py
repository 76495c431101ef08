"""The result of a calibration on series: genes with their errors, and misfits of each channel before and after."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from wingfit.calibration.estimates.uncertainty import Correlations, GeneCovariance
from wingfit.calibration.result import GeneResult

RelativeTo = Literal["noise", "range"]


@dataclass(frozen=True)
class ChannelMisfit:
    """Difference between simulation and recording in one channel of one recording, in ``unit``.

    ``before`` (nominal genome) and ``after`` (best genome) are root mean squares over ``samples`` values; None where
    the genome cannot be simulated, or nothing was recorded. ``noise`` is the standard deviation of one sample: from
    repeats, from the period, as stated, or from the highest frequencies (:mod:`wingfit.inference.noise.series`); None
    if it is not known.
    """

    name: str
    unit: str
    samples: int
    before: float | None
    after: float | None
    noise: float | None


@dataclass(frozen=True)
class SeriesMisfit:
    """Misfits to one recording; ``fitted``: whether its values were fitted.

    ``before`` and ``after`` are root mean squares over all channels, relative (:attr:`SeriesResult.relative_to`).
    """

    name: str
    fitted: bool
    held_out: bool
    before: float | None
    after: float | None
    channels: tuple[ChannelMisfit, ...]


@dataclass(frozen=True)
class Curve:
    """Values of one channel of one recording over time, for a plot: one in ``stride`` of the recorded samples.

    ``time`` is in s; ``recorded``, ``nominal`` and ``best`` (simulated with these genomes) are in ``unit``. None where
    the genome cannot be simulated.
    """

    recording: str
    channel: str
    unit: str
    held_out: bool
    stride: int
    time: tuple[float, ...]
    recorded: tuple[float, ...]
    nominal: tuple[float, ...] | None
    best: tuple[float, ...] | None


@dataclass(frozen=True)
class SeriesResult:
    """Outcome of a calibration of a rig with a simulation of the user's own.

    Genes of one recording, such as an initial angle, are fitted to a recording that is not fitted otherwise, with all
    other genes fixed: for ``before`` with the nominal genome, for ``after`` with the best one. This shows how well the
    other genes predict the recording. Such a gene is not ``searched``; its ``best`` is the value for ``after``.

    Attributes:
        genes: all genes of the model, those of single recordings included, as ``angle_0[first]``.
        recordings: misfits to each recording of the dataset.
        relative_to: what relative misfits are divided by in each channel: "noise", its standard deviation, or, if that
            is not known of every channel, "range", the largest minus the least recorded value.
        before: relative misfit of the nominal genome to the fitted recordings, root mean square over their samples;
            None if it cannot be simulated.
        after: the same of the best genome.
        held_out_before: relative misfit of the nominal genome to the held-out recordings; None without any, or if they
            cannot be simulated.
        held_out_after: the same of the best genome.
        remarks: warnings about the result.
        curves: values over time of the channels that fit worst (:mod:`wingfit.calibration.series.curves`).
        covariance: of the genes whose standard errors are known.
        correlations: those of the genes that were estimated together.
    """

    genes: tuple[GeneResult, ...]
    recordings: tuple[SeriesMisfit, ...]
    relative_to: RelativeTo
    before: float | None
    after: float | None
    held_out_before: float | None
    held_out_after: float | None
    remarks: tuple[str, ...] = ()
    curves: tuple[Curve, ...] = ()
    covariance: GeneCovariance | None = None
    correlations: tuple[Correlations, ...] = ()
