"""The summary of tracked films that the API returns: what the page draws of them."""

from __future__ import annotations

import numpy as np

from wingfit.cameras.track.result import TrackedFilm
from wingfit.client.films import answers as a
from wingfit.records.array_types import Array

MOST_INSTANTS, MOST_SHOWN = 2000, 8


def summary(found: TrackedFilm) -> a.TrackingResult:
    """Return the summary of the tracks ``found``."""
    stride = max(1, -(-len(found.times) // MOST_INSTANTS))
    shown = np.unique(np.linspace(0, len(found.times) - 1, MOST_SHOWN).round().astype(int)).tolist()
    return {
        **found.as_json(),  # type: ignore[typeddict-item]
        "stride": stride,
        "times_s": found.times[::stride].tolist(),
        "found": found.found[::stride].sum(axis=1).tolist(),
        "shown": [_instant(found, number) for number in shown],
    }


def _instant(found: TrackedFilm, number: int) -> a.SeenInstant:
    cameras = range(len(found.cameras))
    return {"time_s": float(found.times[number]), "cameras": [_frame(found, number, camera) for camera in cameras]}


def _frame(found: TrackedFilm, number: int, camera: int) -> a.SeenFrame:
    pixels, residuals = found.pixels[number, camera], found.residuals[number, camera]
    markers: list[a.SeenMarker] = [
        {"marker": name, "seen_px": _pixel(seen), "projected_px": _pixel(seen - residual)}
        for name, seen, residual in zip(found.names, pixels, residuals, strict=True)
    ]
    return {"camera": found.cameras[camera], "frame": int(found.frames[number, camera]), "markers": markers}


def _pixel(at: Array) -> a.Pixel | None:
    return [round(float(value), 3) for value in at] if np.isfinite(at).all() else None
