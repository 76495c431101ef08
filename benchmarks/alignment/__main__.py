"""Proves the alignment of tracks: ``python -m benchmarks.alignment [--json] [--trials N] [--seed N] [--body B]``.

Wings of two independent plants (bodies and springs, a continuous rod), of three sizes and proportions, are filmed with
noise and gaps in random camera axes, left and right, on bodies that rest, drift and fly; labels are missing, mixed up
or swapped for a while, and spurious tracks are added. The alignment gets tracks and an inexact description. Cases that
nobody can settle must be refused. The last line is one JSON object.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.alignment.recordings import BODIES, Body, Trial, make
from benchmarks.alignment.unsettled import Unsettled, unsettled
from benchmarks.common.progress import show_count
from wingfit.records import DatasetError
from wingfit.tracking.alignment import AlignedTracks, Known, Tracks, align

TRIALS = 60
WITHIN_DEG, WITHIN_MM = 0.5, 1.0
NINETY = 1.6449  # standard errors of the stated 90 % interval
GROSS_DEG, GROSS_SPANS, GROSS_LABELS = 2.0, 0.02, 0.02
GROSS_STANDARD = 5.0  # standard errors beyond which an error that is not within the tolerance counts as gross


@dataclass(frozen=True)
class Score:
    """Errors of one alignment: rotation (deg), hinge (mm), labels right and samples kept (fractions), z-scores [6]."""

    rotation: float
    offset: float
    right: float
    kept: float
    z: tuple[float, ...]
    side: bool
    span: float

    @property
    def within(self) -> bool:
        """Whether the frame is within 0.5 deg and 1 mm."""
        return self.side and self.rotation < WITHIN_DEG and self.offset < WITHIN_MM

    @property
    def false(self) -> bool:
        """Whether the answer is grossly wrong: by itself, or beyond the tolerance and far beyond its stated errors."""
        far = self.rotation > GROSS_DEG or self.offset > 1e3 * GROSS_SPANS * self.span
        far = far or (not self.within and max(abs(z) for z in self.z) > GROSS_STANDARD)
        return not self.side or far or self.right < 1 - GROSS_LABELS


def aligned(trial: Trial) -> AlignedTracks:
    """Return the alignment of ``trial`` as a user gets it who knows only which tracks are on the body."""
    tracks = Tracks(trial.label, trial.times, trial.names, trial.tracks)
    return align(tracks, trial.described, Known(body=trial.body))


def score(trial: Trial, found: AlignedTracks) -> Score:
    """Return how far ``found`` is from the truth; with a moving body, frame errors are those of the middle frame."""
    side = (found.side == "left") == trial.left
    names = [one.name for one in trial.wing.markers]
    order = [names.index(name) for name in found.markers]
    every, both = trial.true_positions(), np.isfinite(found.positions[..., 0])
    truth = every[:, order]
    away = np.linalg.norm(found.positions[:, :, None] - every[:, None], axis=-1)
    nearest = np.argmin(np.where(np.isfinite(away), away, np.inf), axis=-1)
    near = (nearest == order) & both
    right = float(near[both].mean()) if side else 0.0
    kept = float(both.sum() / np.isfinite(trial.clean[..., 0]).sum())
    # The frame that the aligned positions are in, relative to the true one, from all positions.
    shown = near & np.isfinite(truth[..., 0])
    a, b = found.positions[shown], truth[shown]
    turned, _ = Rotation.align_vectors(a - a.mean(axis=0), b - b.mean(axis=0))
    hinge = np.array([0.0, trial.wing.hinge.y, trial.wing.hinge.z])
    off = a.mean(axis=0) - turned.apply(b.mean(axis=0) - hinge) - hinge
    errors = np.concatenate([turned.as_rotvec(), off])
    z = errors / np.concatenate([found.rotation_error, found.origin_error])
    degrees = float(np.degrees(turned.magnitude()))
    return Score(degrees, float(1e3 * np.linalg.norm(off)), right, kept, tuple(z.tolist()), side, trial.wing.span)


def main() -> None:
    """Run the trials and print the result."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print only the JSON object")
    parser.add_argument("--trials", type=int, default=TRIALS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--body", choices=BODIES, help="motion of the body of all recordings (default: drawn)")
    given = parser.parse_args()
    print(json.dumps(run((lambda _: None) if given.json else print, given.trials, given.seed, given.body)))


def run(say: Callable[[str], None], trials: int = TRIALS, seed: int = 0, body: Body | None = None) -> dict[str, Any]:
    """Align ``trials`` recordings and try what nobody can align; return the JSON object.

    ``say``: called with a line about each; ``seed``: of the first recording, the others follow; ``body``: its motion
    in all of them, by default drawn for each.
    """
    began = time.monotonic()
    scores, refused = list[Score](), list[str]()
    for number in range(trials):
        trial = make(seed + number, body)
        try:
            scores.append(score(trial, aligned(trial)))
            one = scores[-1]
            parts = f"labels {100 * one.right:.1f} %, kept {100 * one.kept:.1f} %"
            text = f"{one.rotation:.2f} deg {one.offset:.2f} mm, {parts}"
            text += "" if one.side else " WRONG SIDE"
        except DatasetError as error:
            refused.append(f"{seed + number} {trial.label}: {error}")
            text = f"refused: {error}"
        say(f"{seed + number:3d} {trial.label}: {text}")
        show_count("alignment", number + 1, trials, began)
    sure = [(case, answer) for case in unsettled() if (answer := _answer(case)) is not None]
    for case, answer in sure:
        say(f"not refused: {case.name}: {answer}")
    return _summary(scores, refused, len(sure), trials, time.monotonic() - began)


def _answer(case: Unsettled) -> str | None:
    """Return what was answered to a case that nobody can settle; None if it was refused."""
    try:
        found = align(case.tracks, case.wing, Known())
    except DatasetError:
        return None
    return f"{found.side} wing, {len(found.markers)} markers"


def _summary(scores: list[Score], refused: list[str], sure: int, trials: int, seconds: float) -> dict[str, Any]:
    rotation, offset = (np.array([getattr(one, name) for one in scores]) for name in ("rotation", "offset"))
    z = np.array([one.z for one in scores])
    summary = {
        "n": trials,
        "rotation_deg": {"median": _at(rotation, 50), "p90": _at(rotation, 90)},
        "offset_mm": {"median": _at(offset, 50), "p90": _at(offset, 90)},
        "labels_right_percent": round(100 * float(np.mean([one.right for one in scores])), 2),
        "samples_kept_percent": round(100 * float(np.mean([one.kept for one in scores])), 2),
        "within_percent": round(100 * sum(one.within for one in scores) / trials, 1),
        "rms_of_error_over_standard_error": [round(float(v), 2) for v in np.sqrt(np.mean(z**2, axis=0))],
        "within_stated_90_percent_interval": _shares(np.abs(z) < NINETY),
        "accepted_percent": round(100 * len(scores) / trials, 1),
        "refused": len(refused),
        "refusals": refused,
        "unsettled": len(unsettled()),
        "falsely_sure": sum(one.false for one in scores) + sure,
    }
    return {"alignment": summary, "seconds": round(seconds, 1)}


def _shares(inside: np.ndarray) -> dict[str, Any]:
    """Return how many percent of the errors [N, 6] are inside their intervals: all, and each of the six."""
    names = ("rotation_x", "rotation_y", "rotation_z", "position_x", "position_y", "position_z")
    each = dict(zip(names, np.round(100 * inside.mean(axis=0), 1).tolist(), strict=True))
    return {"all": round(100 * float(inside.mean()), 1), **each}


def _at(values: np.ndarray, percent: float) -> float:
    return round(float(np.percentile(values, percent)), 3)


if __name__ == "__main__":
    main()
