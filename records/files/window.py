"""The part of a recording that a dataset uses: a window in time or in beats, for rigs that glide, start or stop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wingfit.records.description.convert import RecordingFile
from wingfit.records.description.yaml_text import Document, Path
from wingfit.records.errors import Faults
from wingfit.records.files.table import Samples

LEAST = 2  # samples in a window
_ROUNDING = 1e-9  # of a window's end: times such as 0.1 + 0.2 count as within


def in_window(entry: RecordingFile, samples: Samples, document: Document, path: Path, faults: Faults) -> Samples:
    """Return the rows of ``samples`` in the window that ``entry`` states; all of them if it states none.

    Beats are periods of the stated flap frequency, from time 0. A fault is added for a window without enough samples,
    or that begins or ends outside the recording. ``path`` is the position of ``entry`` in ``document``.
    """
    key, stated = ("window_s", entry.window_s) if entry.window_s else ("window_beats", entry.window_beats)
    if not stated:
        return samples
    unit = 1.0 if entry.window_s else 1.0 / float(entry.flap_frequency_hz)
    start, end = (float(one) * unit for one in stated)
    times, slack = samples.times, _ROUNDING * max(abs(start), abs(end))
    kept = (times >= start - slack) & (times <= end + slack)
    seen = f"samples are from {times.min():.6g} to {times.max():.6g} s" if len(times) else "there are no samples"
    text = f"[{stated[0]}, {stated[1]}]"
    where = document.where((*path, key))
    if end <= start:
        faults.add(where, text, "ends before it starts: give the start, then the end")
        return samples
    if kept.sum() < LEAST:
        count = f"with {int(kept.sum())} samples, and needs {LEAST}"
        faults.add(where, text, f"is {start:.6g} to {end:.6g} s, {count}; {seen}: choose a window in these times")
        return samples
    step = float(np.median(np.diff(times)))
    if start < times.min() - step or end > times.max() + step:
        faults.add(where, text, f"is {start:.6g} to {end:.6g} s, and {seen}: choose a window in these times")
    return replace(samples, times=times[kept], values=samples.values[kept], lines=samples.lines[kept])
