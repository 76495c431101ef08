"""Reads files of other programs that were written by code that shares nothing with the importers.

1. For every format, files are written (vendors' layouts, h5py, ezc3d where it is installed) and read again: names,
   times, gaps and positions must be those that were written.
2. Files that do not state unit or rate, and options that contradict the file, must be refused with a message that names
   the option. Each that is accepted counts as a silent guess.
3. Files are changed at random. Whatever happens other than tracks (complete, finite, with increasing times) or a
   DatasetError with a remedy, counts as a crash.
4. C3D files are cut off at random: how many are read without a word about missing frames, here and by ezc3d.
"""

from __future__ import annotations

import random
import resource
import time
import traceback
import warnings
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.data_in.binary_writers import have_ezc3d
from benchmarks.data_in.cases import Case, cases, refusals
from benchmarks.data_in.cut_off import read_without_a_word
from benchmarks.data_in.mutate import mutated
from wingfit.importers import Given, ImportedTracks, import_bytes
from wingfit.records import DatasetError

MISLEADING = "recording.dat"  # a name from which no format follows
SEEDS, MUTATIONS = 6, 1500
SLOW_S = 60.0
SLEAP_SHARE = 0.04  # of the changed files: each starts a process


def measure(case: Case) -> float:
    """Return the largest error of a position, mm; infinity if names, gaps, times or format differ."""
    found = import_bytes(case.raw, MISLEADING, Given(**case.options))
    truth = case.truth
    names = truth.names if case.named else found.markers
    times = case.start_s + np.arange(truth.frames) / truth.rate
    same = found.format == case.format and set(found.markers) == set(names) and len(found.times) == truth.frames
    if not same or np.abs(found.times - times).max() > 1e-6:
        return float("inf")
    positions = found.positions[:, [found.markers.index(name) for name in names]]
    gaps = np.isnan(truth.mm)
    if not np.array_equal(np.isnan(positions), gaps) or found.gaps.total != int(gaps.any(axis=2).sum()):
        return float("inf")
    return float(np.abs(positions * 1e3 - truth.mm)[~gaps].max())


def guessed(seed: int, only: str | None) -> tuple[Counter[str], Counter[str], list[str]]:
    """Return counts by format of the files that must be refused, of those that were not, and what went wrong."""
    tried, silent, notes = Counter[str](), Counter[str](), []
    for refusal in refusals(seed):
        if only and refusal.format != only:
            continue
        tried[refusal.format] += 1
        try:
            import_bytes(refusal.raw, MISLEADING, Given(**refusal.options))
            silent[refusal.format] += 1
            notes.append(f"{refusal.format} {refusal.options} was accepted; it should name {refusal.words}")
        except DatasetError as error:
            missing = [word for word in refusal.words if word not in str(error)]
            if missing:
                silent[refusal.format] += 1
                notes.append(f"{refusal.format} {refusal.options}: {missing} is not in the message: {error}")
    return tried, silent, notes


def outcome(raw: bytes, given: Given) -> str:
    """Return "read", "refused", or what went wrong."""
    started = time.monotonic()
    warnings.simplefilter("error")  # a warning that nobody expected is a fault, too
    try:
        found = import_bytes(raw, MISLEADING, given)
        bad = _wrong(found)
    except DatasetError as error:
        bad = "" if all(one.where and one.message for one in error.errors) else "an error without place or message"
        return bad or ("refused" if time.monotonic() - started < SLOW_S else "slow")
    except Exception:
        return traceback.format_exc()
    return bad or ("read" if time.monotonic() - started < SLOW_S else "slow")


def _wrong(found: ImportedTracks) -> str:
    whole = np.isfinite(found.positions).all(axis=2) | np.isnan(found.positions).all(axis=2)
    fine = whole.all() and np.isfinite(found.times).all() and (np.diff(found.times) > 0).all()
    return "" if fine and len(set(found.markers)) == len(found.markers) else "tracks that break the contract"


def fuzz(count: int, seed: int, only: str | None) -> tuple[Counter[str], list[str]]:
    """Change ``count`` files at random; return counts of outcomes, and descriptions of crashes."""
    dice = random.Random(seed)  # noqa: S311  # no secret
    bases = [case for case in cases(seed) if not only or case.format == only]
    raws = [case.raw for case in bases]
    text = [case for case in bases if case.format != "sleap"] or bases
    sleap = [case for case in bases if case.format == "sleap"] or bases
    outcomes, crashes = Counter[str](), []
    for number in range(count):
        case = dice.choice(sleap if dice.random() < SLEAP_SHARE else text)
        raw = mutated(case.raw, raws, dice)
        given = Given(**case.options)
        if dice.random() < 0.3:  # without options, and with other ones
            given = replace(given, unit=None, rate_hz=None, keep_zeros=True, keep_unlabelled=True, incomplete=True)
        result = outcome(raw, given)
        outcomes[result if result in ("read", "refused") else "crash"] += 1
        if result not in ("read", "refused"):
            crashes.append(f"{case.format}, file {number} of seed {seed}: {result}")
    return outcomes, crashes


def run(seeds: int, mutations: int, only: str | None) -> tuple[dict[str, Any], list[str]]:
    """Return the measurements, and lines about everything that went wrong."""
    notes, errors, files = list[str](), dict[str, float](), Counter[str]()
    tried, silent = Counter[str](), Counter[str]()
    for seed in range(seeds):
        for case in cases(seed):
            if only and case.format != only:
                continue
            files[case.format] += 1
            try:
                error = measure(case)
            except DatasetError as refused:
                error = float("inf")
                notes.append(f"{case.format} {case.options}: {refused}")
            errors[case.format] = max(errors.get(case.format, 0.0), error)
    tried, silent, wrong = guessed(0, only)
    outcomes, crashes = fuzz(mutations, 1, only)
    formats = [
        {
            "format": name,
            "files": files[name],
            "max_error_mm": errors[name],
            "must_refuse": tried[name],
            "silent_guesses": silent[name],
        }
        for name in files
    ]
    result = {
        "formats": formats,
        "mutated_files": sum(outcomes.values()),
        "mutated_read": outcomes["read"],
        "mutated_refused": outcomes["refused"],
        "crashes": outcomes["crash"],
        "c3d_cut_off": read_without_a_word(),
        "c3d_written_by": "ezc3d and by hand" if have_ezc3d() else "by hand; ezc3d is not installed",
        "peak_memory_mib": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
    }
    return result, [*notes, *wrong, *crashes]
