"""Remarks on the noise of series: where it is known from, and whether it can be right."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wingfit.diagnosis.evidence.fit import Fit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.verdict.noise_doubt import overstated, residual_to_noise, uncertain
from wingfit.inference.noise.series import EXCEEDS

UNEVEN = 3.0  # times the least noise of a channel: recordings with more get a remark
SOURCES = {
    "repeats": "the differences between repeats",
    "period": "the differences between periods",
    "stated": "what the dataset states",
    "highest frequencies": "the highest frequencies, which show no slow noise; state it, or record repeats",
    "resolution": "the resolution of the recorder",
    "other recordings": "the other recordings",
}


def series_remarks(data: WhitenedData, nominal: Fit, *, adequate: bool) -> tuple[str, ...]:
    """Return remarks on the noise; ``nominal``: fit of the nominal model; ``adequate``: whether it is called so."""
    doubts = _doubts(data, nominal) if adequate else ()
    return (*_sources(data), *_uneven(data), *_contradicted(data), *_unsteady(data), *doubts)


def _sources(data: WhitenedData) -> Iterator[str]:
    noises = data.series.noises if data.series else {}
    by_source: dict[str, list[str]] = {}
    for one in data.recordings:
        by_source.setdefault(noises[one.name].source, []).append(one.name)
    for source, names in by_source.items():
        where = "" if len(by_source) == 1 else f" of {', '.join(names)}"
        yield f"the noise{where} is known from {SOURCES[source]}"


def _uneven(data: WhitenedData) -> Iterator[str]:
    """Yield a remark for each channel whose noise differs several-fold between recordings."""
    noises = data.series.noises if data.series else {}
    for c, channel in enumerate(data.recordings[0].channels):
        levels = {one.name: float(noises[one.name].standard_deviation[c]) for one in data.recordings}
        least = min(levels.values())
        loud = [name for name, level in levels.items() if level > UNEVEN * least]
        if loud:
            yield (
                f"the noise of {channel} in {', '.join(loud)} is more than {UNEVEN:g} times that of the quietest "
                "recording: missing physics may hide in it"
            )


def _unsteady(data: WhitenedData) -> Iterator[str]:
    if not data.is_steady:
        yield (
            "the residual differs between recordings, or between parts of their time, as stationary noise of no colour "
            "does: it is not taken for slow noise"
        )


def _contradicted(data: WhitenedData) -> Iterator[str]:
    """Yield a remark for each channel whose stated noise is far from that of the highest frequencies."""
    noises = data.series.noises if data.series else {}
    for c, channel in enumerate(data.recordings[0].channels):
        ratios = [
            noises[one.name].visible[c] / noises[one.name].standard_deviation[c]
            for one in data.recordings
            if noises[one.name].source in ("stated", "repeats", "period") and np.isfinite(noises[one.name].visible[c])
        ]
        if not ratios:
            continue
        ratio = float(np.median(ratios))
        if ratio > EXCEEDS or ratio < 1.0 / EXCEEDS:
            yield (
                f"the highest frequencies of {channel} have {ratio:.2g} times the assumed standard deviation: check it "
                "and that repeats start alike; too large a noise hides missing physics, too small a one imitates it"
            )


def _doubts(data: WhitenedData, nominal: Fit) -> Iterator[str]:
    ratio = residual_to_noise(data, nominal)
    if uncertain(data, nominal):
        yield (
            f"the residual is {ratio:.2g} times the noise that the highest frequencies show; whether slow noise or "
            "missing physics causes it cannot be known: state the standard deviation, or record repeats"
        )
    if overstated(data, nominal):
        yield (
            f"the residual is {ratio:.2g} times the assumed noise, so the noise is smaller; physics may be "
            "missing that is smaller than the assumed noise; state the right standard deviation, or record repeats"
        )
