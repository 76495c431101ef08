"""Cameras and tracks on films whose truth is known: ``python -m benchmarks.cameras [--json] [--keep FOLDER]``.

Renders strobe films of 49 markers as in the thesis of van der Grinten, films in continuous light, and films of three
cameras of which one is late; calibrates the cameras from rendered chessboards, tracks, and compares with the truth. The
stereo pairs of OpenCV's samples are calibrated if the environment variable OPENCV_DOC_DATA names their folder. With
``--diagnose``, wings are filmed under five conditions, tracked, aligned and diagnosed: one with a displaced hinge, and
one of which the tracks are made without the distortion of the lenses. With ``--long``, memory and time are measured of
films whose detections are repeated. The last line is one JSON object.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.cameras.diagnosed import DIAGNOSED
from benchmarks.cameras.long import long_films
from benchmarks.cameras.peers import peers
from benchmarks.cameras.tracked import Tracked, render_and_track
from benchmarks.cameras.wand_lengths import wand_error_percent
from benchmarks.common.machine import commit, cpu
from benchmarks.common.progress import show_count
from wingfit.cameras.calibrate.board import Board
from wingfit.cameras.calibrate.boards import find_boards
from wingfit.cameras.calibrate.from_boards import calibrate_boards

VARIABLE = "OPENCV_DOC_DATA"
FLASHES, BEATS = 90, 1.0
MINUTES = 4.0


def main() -> None:
    """Run the benchmark and print its results."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.cameras", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")
    parser.add_argument("--flashes", type=int, default=FLASHES, help="number of flashes of the strobe film")
    parser.add_argument("--beats", type=float, default=BEATS, help="beats filmed in continuous light")
    parser.add_argument("--seed", type=int, default=1, help="the same seed gives the same films")
    parser.add_argument(
        "--diagnose",
        nargs="*",
        choices=sorted(DIAGNOSED),
        help="diagnose wings from films alone, and nothing else: one with a displaced hinge, one filmed through lenses "
        "whose distortion is left out, this one with cameras calibrated without distortion; default: all",
    )
    parser.add_argument("--long", action="store_true", help="measure memory and time of long films, and nothing else")
    parser.add_argument("--minutes", type=float, default=MINUTES, help="length of the longest film of --long")
    parser.add_argument("--keep", type=Path, help="store the films in this folder, and use those already there")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = chosen.keep or Path(scratch)
        if chosen.long:
            found = {**long_films(folder, chosen.minutes), "commit": commit(), "machine": cpu()}
        elif chosen.diagnose is not None:
            found = _diagnosed(folder, chosen.diagnose or sorted(DIAGNOSED))
        else:
            found = _run(folder, chosen.flashes, chosen.beats, chosen.seed)
    for name, value in found.items():
        print(f"{name:24} {value}")
    if chosen.json:
        print(json.dumps(found))


def _run(folder: Path, flashes: int, beats: float, seed: int) -> dict[str, Any]:
    films: dict[str, tuple[str, dict[str, Any]]] = {
        "strobe": ("thesis_strobe", {"flashes": flashes, "seed": seed}),
        "continuous": ("continuous", {"beats": beats, "seed": seed}),
        "one_late": ("three_cameras_late", {"beats": beats, "seed": seed}),
    }
    tracked: dict[str, Tracked] = {}
    for name, (preset, options) in films.items():
        began = time.monotonic()

        def progress(step: str, part: float, name: str = name, began: float = began) -> None:
            show_count(f"{name}, {step}", max(round(100 * part), 1), 100, began)

        tracked[name] = render_and_track(preset, folder / f"{name}-{seed}", options, progress)
    strobe = tracked["strobe"].as_json()
    continuous = tracked["continuous"]
    return {
        "markers_tracked_of_49": strobe["tracked_in_95_percent_of_frames"],
        "error_mm": strobe["error_mm"],
        "field_over_error": strobe["field_over_error"],
        "coverage_percent": strobe["coverage_percent"],
        "wand_error_percent": round(
            wand_error_percent(folder / f"continuous-{seed}", continuous.calibration.cameras), 4
        ),
        "frames_per_second": strobe["frames_per_second"],
        "stereo_rms_px": _stereo_rms_px(),
        "films": {name: one.as_json() for name, one in tracked.items()},
        "peers": peers(tracked["strobe"]),
        "commit": commit(),
        "machine": cpu(),
    }


def _diagnosed(folder: Path, cases: Sequence[str]) -> dict[str, Any]:
    """Film, track and diagnose the wings of ``cases``; return what was found."""
    found = dict[str, Any]()
    for case in cases:
        found |= DIAGNOSED[case](folder)
    return found | {"commit": commit(), "machine": cpu()}


def _stereo_rms_px() -> float | None:
    """Return the RMS error of both cameras of OpenCV's stereo samples; None if they are not there."""
    place = os.environ.get(VARIABLE)
    if not place:
        return None
    images = {side: sorted(Path(place).glob(f"{side}[0-9][0-9].jpg")) for side in ("left", "right")}
    found = calibrate_boards(find_boards(images, Board(9, 6, 0.025)))
    return round(found.rms_px, 4)


if __name__ == "__main__":
    main()
