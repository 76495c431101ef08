"""What a user checks before using tracks: of each marker how often it is seen, where it moves, how far it jumps."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from wingfit.importers.tracks import ImportedTracks


@dataclass(frozen=True)
class MarkerSummary:
    """One marker.

    Attributes:
        name, label: names in the dataset and in the file.
        seen: fraction of the frames.
        low_m, high_m: smallest and largest x, y, z, m.
        largest_jump_m: largest distance between two consecutive frames that show it, m; None if there are none.
        jump_time_s: time of the second of these frames, s.
    """

    name: str
    label: str
    seen: float
    low_m: tuple[float, float, float]
    high_m: tuple[float, float, float]
    largest_jump_m: float | None
    jump_time_s: float | None


def summaries(tracks: ImportedTracks) -> list[MarkerSummary]:
    """Return the summary of each marker of ``tracks``."""
    found = []
    for m, (name, label) in enumerate(zip(tracks.markers, tracks.labels, strict=True)):
        track = tracks.positions[:, m]
        seen = np.isfinite(track).all(axis=1)
        jumps = np.linalg.norm(np.diff(track, axis=0), axis=1)
        both = np.isfinite(jumps)
        at = int(np.argmax(np.where(both, jumps, -1.0))) if both.any() else None
        low, high = np.min(track[seen], axis=0).tolist(), np.max(track[seen], axis=0).tolist()
        found.append(
            MarkerSummary(
                name=name,
                label=label,
                seen=float(seen.mean()),
                low_m=(low[0], low[1], low[2]),
                high_m=(high[0], high[1], high[2]),
                largest_jump_m=None if at is None else float(jumps[at]),
                jump_time_s=None if at is None else float(tracks.times[at + 1]),
            )
        )
    return found


def as_json(tracks: ImportedTracks) -> dict[str, Any]:
    """Return everything about ``tracks`` but the positions, for JSON."""
    return {
        "file": tracks.file,
        "format": tracks.format,
        "frames": len(tracks.times),
        "start_s": float(tracks.times[0]),
        "duration_s": tracks.duration_s,
        "rate_hz": tracks.rate_hz,
        "frame": tracks.frame,
        "statements": [asdict(one) for one in tracks.statements],
        "gaps": asdict(tracks.gaps),
        "markers": [asdict(one) for one in summaries(tracks)],
        "remarks": list(tracks.remarks),
    }
