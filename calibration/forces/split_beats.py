"""Splits a recording of forces into beats, and into pieces for spectra."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records import Recording
from wingfit.records.array_types import Array, Index

EDGE = 1e-6  # beats by which a sample may miss the start of a beat and still be its first


@dataclass(frozen=True)
class Cut:
    """Beats of a recording: ``beat`` [T] numbers each sample's beat; ``gapless`` [B]: whole beats without a gap."""

    beat: Array
    gapless: Array

    @classmethod
    def of(cls, recording: Recording) -> Cut:
        """Split ``recording`` into beats, from its times and flap frequency; ValueError if no whole beat has no gap."""
        f, times = recording.condition.flap_frequency, recording.times
        step = float(np.median(np.diff(times)))
        beat = np.floor(f * times + EDGE)
        whole = np.arange(np.ceil(f * times[0] - EDGE), np.floor(f * (times[-1] + step) + EDGE))
        broken = beat[~recording.valid.all(axis=1)]
        gapless = whole[np.isin(whole, beat) & ~np.isin(whole, broken)]
        if not len(gapless):
            lasts = times[-1] - times[0] + step
            why = (
                f"each of its {len(whole)} whole beats lacks samples; fill the gaps of all force axes, record longer"
                if len(whole)
                else f"no beat of {1 / f:.4g} s begins and ends in its {lasts:.4g} s; record at least one, better ten"
            )
            raise ValueError(
                f"recording {recording.name!r} holds no whole beat without a gap: {why}, or leave the recording out"
            )
        return cls(beat, gapless)


def pieces(recording: Recording, beats: int) -> Index:
    """Return the sample indices [pieces, length] of consecutive pieces of ``beats`` beats without gaps.

    If no part of the recording without gaps is that long, pieces are shorter; without a whole beat the result is empty.
    A piece may begin at any phase of the beat, which does not change the spectrum of a periodic force.
    """
    rows = np.flatnonzero(recording.valid.all(axis=1))
    runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    longest = max((len(run) for run in runs), default=0)
    step = float(np.median(np.diff(recording.times)))
    per_beat = 1.0 / (recording.condition.flap_frequency * step)
    # A beat of 12.5 samples may have 12 or 13 of them.
    length = min(round(min(beats, int((longest + 1) / per_beat)) * per_beat), longest)
    if not length:
        return np.empty((0, 0), np.int64)
    found = [run[: len(run) // length * length].reshape(-1, length) for run in runs]
    return np.concatenate(found)
