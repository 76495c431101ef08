"""Memory and time of tracking a long film: a short rendered film whose detections are repeated.

``python -m benchmarks.cameras.long FOLDER INSTANTS`` tracks one such film in this process, and prints its highest
memory and its CPU time: the detections of the film in FOLDER fill a store, as if a film of so many instants had been
read. A strobe flashes every 3.1 frames of 30 per second; continuous light has an instant in each frame.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks.cameras.render import write
from benchmarks.cameras.renderer.presets import PRESETS
from benchmarks.cameras.tracked import request_of
from benchmarks.cameras.write import write_video
from wingfit.cameras.markers.stored import DetectionStore
from wingfit.cameras.track.film_detections import FilmDetections, FilmTask, Light, detect_film
from wingfit.cameras.track.procedure import Request, track
from wingfit.cameras.video.source import Film, Frames
from wingfit.cameras.video.strobe import FlashMark

RATE_HZ, FRAMES_PER_FLASH = 30.0, 3.1
FLASHES = 62  # of the short film: two apparent beats of 31, so that its end fits to its beginning
LENGTHS = (1, 4, 16)
_SPLIT_WITHIN = 5.0  # rows
_VIDEO_SIZE, _VIDEO_FRAMES = (320, 240), 500
_DETECTED = "detected"


def long_films(folder: Path, minutes: float) -> dict[str, Any]:
    """Return memory and time of films of up to ``minutes``, and of films of up to 16 beats in continuous light."""
    places = {light: _rendered(folder, light) for light in ("strobe", "continuous")}
    beat = {light: len(_detected(request_of(place), place / _DETECTED)[0].seen) for light, place in places.items()}
    longest = round(minutes * 60 * RATE_HZ / FRAMES_PER_FLASH)
    runs = [_tracked_apart(places["strobe"], longest * of // LENGTHS[-1]) for of in LENGTHS]
    growth = (runs[-1]["peak_memory_mb"] - runs[0]["peak_memory_mb"]) / (minutes * (1 - LENGTHS[0] / LENGTHS[-1]))
    fast = [_tracked_apart(places["continuous"], beat["continuous"] * of) for of in LENGTHS]
    return {
        "minutes": minutes,
        "peak_memory_mb": runs[-1]["peak_memory_mb"],
        "memory_growth_mb_per_minute": round(growth, 2),
        "seconds_per_instant": [run["seconds_per_instant"] for run in runs],
        "instants": [run["instants"] for run in runs],
        "continuous": {name: [run[name] for run in fast] for name in fast[0]},
        "seconds_to_last_frame": {suffix: _seek_seconds(suffix) for suffix in (".avi", ".mp4")},
    }


def _rendered(folder: Path, light: str) -> Path:
    """Return the folder of a short film, which is rendered if it is not there."""
    place = folder / f"{light}-1"
    if not (place / "done").exists():
        strobe = light == "strobe"
        made = PRESETS["thesis_strobe" if strobe else "continuous"](**({"flashes": FLASHES + 3} if strobe else {}))
        write(made, place)
        (place / "done").touch()
    return place


def _tracked_apart(place: Path, instants: int) -> dict[str, Any]:
    """Track in a process of its own, whose highest memory is that of this film."""
    command = [sys.executable, "-m", __name__, str(place), str(instants)]
    ran = subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603  # this module
    found: dict[str, Any] = json.loads(ran.stdout.splitlines()[-1])
    print(place.name, found, file=sys.stderr, flush=True)
    return found


def _detected(request: Request, store: Path) -> list[FilmDetections]:
    """Detect the markers of the short film, unless that was done before."""
    tasks = [FilmTask(film, request.kind, request.light, store) for film in request.films]
    return [detect_film(task, lambda _done, _of: None) for task in tasks]


@dataclass(frozen=True)
class _Replayed(Film):
    """A film that is said to have ``count`` frames; none is read, as its detections are stored."""

    count: int = 0

    def opened(self) -> Frames:
        frames = super().opened()
        frames.count = self.count
        return frames


def main(arguments: list[str]) -> None:
    """Track one long film, and print its memory and time."""
    place, instants = Path(arguments[0]), int(arguments[1])
    short = request_of(place)
    seen = _detected(short, place / _DETECTED)
    frames = round(instants * FRAMES_PER_FLASH) + 2 if short.light == "strobe" else instants
    rates = [RATE_HZ if short.light == "strobe" else film.rate_hz for film in short.films]
    films = tuple(_Replayed(film.path, rate, frames) for film, rate in zip(short.films, rates, strict=True))
    with tempfile.TemporaryDirectory() as store:
        request = replace(short, films=films, store=Path(store))
        for film, of, camera in zip(films, seen, request.cameras, strict=True):
            task = FilmTask(film, request.kind, request.light, Path(store))
            marks = _marks(request.light, instants, camera.size_px[1])
            _replay(of, DetectionStore(Path(store) / task.key), request.light, marks)
        began = time.process_time()
        found = track(request)
        found.csv()
        seconds = time.process_time() - began
    peak = _highest_mb()
    each = round(seconds / len(found.times), 5)
    print(json.dumps({"instants": len(found.times), "peak_memory_mb": round(peak), "seconds_per_instant": each}))


def _highest_mb() -> float:
    """Return the highest memory of this process; ru_maxrss begins with that of the process that started it."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.split("VmHWM:")[1].split()[0]) / 1024


def _marks(light: Light, instants: int, rows: int) -> Iterator[FlashMark]:
    """Return where the instants are in the long film."""
    for number in range(instants):
        frame, part = divmod(number * FRAMES_PER_FLASH if light == "strobe" else number, 1)
        split = rows * part
        yield FlashMark(int(frame), split, (split - _SPLIT_WITHIN, split + _SPLIT_WITHIN))


def _replay(seen: FilmDetections, store: DetectionStore, light: Light, marks: Iterator[FlashMark]) -> None:
    period = FLASHES if light == "strobe" else len(seen.seen)
    for number, mark in enumerate(marks):
        store.add(mark, seen.seen[number % period], ())
    store.finish((), None)


def _seek_seconds(suffix: str) -> list[float]:
    """Return the CPU time to read the last frame of videos of growing length."""
    found, random = [], np.random.default_rng(1)
    base = cv2.resize(random.integers(0, 255, (30, 40), np.uint8), _VIDEO_SIZE)
    with tempfile.TemporaryDirectory() as folder:
        for of in LENGTHS:
            count, path = _VIDEO_FRAMES * of, Path(folder) / f"{of}{suffix}"
            write_video(path, (np.roll(base, number, 1) for number in range(count)), _VIDEO_SIZE, RATE_HZ)
            frames = Film(path).opened()
            began = time.process_time()
            number, _ = next(frames.read(count - 1))
            found.append(round(time.process_time() - began, 4))
            if number != count - 1:
                raise RuntimeError(f"{path} shows frame {number} where {count - 1} was sought")
    return found


if __name__ == "__main__":
    main(sys.argv[1:])
