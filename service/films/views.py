"""Converts database rows to the API's JSON answers about films and trackings."""

from __future__ import annotations

from typing import Any

from wingfit.client.films import answers as a
from wingfit.service.answers import checked
from wingfit.service.films.files import FilmFiles
from wingfit.service.films.requests import CALIBRATION
from wingfit.service.runs.views import columns
from wingfit.service.storage.tables import FilmRow, TrackingRow
from wingfit.workers.jobs import Wish

FACTS = ("bytes", "frames", "width_px", "height_px")


def new_camera(name: str, rate_hz: float | None) -> dict[str, Any]:
    """Return a camera without video, as a row of a film stores it."""
    return {"name": name, "stated_rate_hz": rate_hz, "file": None, "rate_hz": None, **dict.fromkeys(FACTS)}


def uploaded(row: FilmRow) -> dict[str, str]:
    """Return the uploaded files of a film: name of the file in the data folder, by name in the API."""
    named = {CALIBRATION: row.calibration, **{camera["name"]: camera["file"] for camera in row.cameras}}
    return {name: file for name, file in named.items() if file is not None}


def absent(row: FilmRow, files: FilmFiles) -> list[str]:
    """Return the names of files of a film that are not on the disk of this server."""
    named = uploaded(row)
    wanted = (CALIBRATION, *(camera["name"] for camera in row.cameras))
    return [name for name in wanted if name not in named or not files.video(row.id, named[name]).is_file()]


def film(row: FilmRow, files: FilmFiles) -> a.Film:
    """Return the JSON answer about the film in ``row``, whose files are looked for."""
    named, gone = uploaded(row), absent(row, files)
    missing = [name for name in gone if name in named]
    cameras = [_camera(camera, camera["name"] in missing) for camera in row.cameras]
    found: a.Film = {
        "id": row.id,
        "name": row.name,
        "created_at": row.created_at,
        "cameras": cameras,
        "calibration": CALIBRATION not in gone,
        "ready": not gone,
        "missing": missing,
        "size_bytes": row.size_bytes,
    }
    return checked(a.Film, found)


def _camera(camera: dict[str, Any], missing: bool) -> a.FilmCamera:
    known: dict[str, Any] = {name: None if missing else camera[name] for name in FACTS}
    rate = camera["stated_rate_hz"] if camera["stated_rate_hz"] is not None or missing else camera["rate_hz"]
    return {"name": camera["name"], "rate_hz": rate, **known}  # type: ignore[typeddict-item]


def tracking(row: TrackingRow) -> a.Tracking:
    """Return the JSON answer about the tracking in ``row``."""
    action = None if row.wish == Wish.NONE else row.wish
    return checked(a.Tracking, {**columns(row), "pending_action": action, "steps": row.generations})
