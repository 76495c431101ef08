"""JSON answers of the server about calibrations of rigs of the user's own."""

from __future__ import annotations

from typing import Literal, NotRequired

from typing_extensions import TypedDict

from wingfit.client.answers import GeneInfo
from wingfit.client.estimates.answers import Correlations, GeneCovariance


class ChannelResult(TypedDict):
    """Root mean square difference in one channel of a recording, in ``unit``: with the nominal and the best genome.

    ``noise`` is the standard deviation of one sample. Null: not known, or the genome cannot be simulated.
    """

    name: str
    unit: str
    samples: int
    before: float | None
    after: float | None
    noise: float | None


class SeriesRecordingResult(TypedDict):
    """Misfit to one recording, relative to noise or range, with the nominal and the best genome."""

    name: str
    fitted: bool
    held_out: bool
    before: float | None
    after: float | None
    channels: list[ChannelResult]


class Curve(TypedDict):
    """Values of one channel of one recording over time, in ``unit``: one in ``stride`` of the recorded samples.

    ``nominal`` and ``best`` are simulated with these genomes; null where the genome cannot be simulated.
    """

    recording: str
    channel: str
    unit: str
    held_out: bool
    stride: int
    time_s: list[float]
    recorded: list[float]
    nominal: list[float] | None
    best: list[float] | None


class SeriesResult(TypedDict):
    """Result of a calibration of a rig of the user's own.

    ``before`` (nominal genome) and ``after`` (best genome) are root mean squares over the fitted recordings, in each
    channel divided by the standard deviation of its noise or, where that is not known of all, by its range
    (``relative_to``). ``curves`` are those of the channels that fit worst, that with the largest misfit first.
    ``covariance`` is that of the genes whose standard errors are known. Results of earlier versions have neither.
    """

    kind: Literal["series"]
    relative_to: Literal["noise", "range"]
    before: float | None
    after: float | None
    held_out_before: float | None
    held_out_after: float | None
    remarks: list[str]
    recordings: list[SeriesRecordingResult]
    genes: list[GeneInfo]
    curves: NotRequired[list[Curve]]
    covariance: NotRequired[GeneCovariance | None]
    correlations: NotRequired[list[Correlations]]
