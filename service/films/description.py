"""Writes the description of films (``film.yaml``) that the tracking of a film reads, as 'wingfit track' does."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from decimal import Decimal
from pathlib import Path
from typing import Any

from wingfit.client import private_files
from wingfit.records.description.yaml_text import write_yaml
from wingfit.service.films.files import CAMERAS, FilmFiles
from wingfit.service.films.requests import CALIBRATION
from wingfit.service.films.views import uploaded
from wingfit.service.storage.tables import FilmRow

DESCRIPTION, PLACES, LABELS = "film.yaml", "markers.csv", "labels.csv"


def write_description(folder: Path, row: FilmRow, spec: Mapping[str, Any], files: FilmFiles) -> Path:
    """Write ``film.yaml`` into ``folder``, with the cameras and tables that it names beside it; return its path.

    ``row``: the film, all of whose files are there; ``spec``: settings of a tracking.
    """
    named = {name: str(files.video(row.id, file).resolve()) for name, file in uploaded(row).items()}
    # A copy, which shows later with which cameras the tracks were made.
    _write(folder / CAMERAS, Path(named[CALIBRATION]).read_bytes().decode())
    markers: dict[str, Any] = {"kind": spec["kind"]}
    if spec["places"]:
        _write(folder / PLACES, _table(("marker", "x_m", "y_m", "z_m"), spec["places"]))
        markers["places"] = PLACES
    data = {
        "format": "wingfit film",
        "version": 1,
        "cameras": CAMERAS,
        "light": spec["light"],
        "films": {camera["name"]: _film(named[camera["name"]], camera["stated_rate_hz"]) for camera in row.cameras},
        "markers": markers,
        "clocks_within_ms": Decimal(repr(spec["clocks_within_ms"])),
        "first_frame": spec["first_frame"],
    }
    if spec["last_frame"] is not None:
        data["last_frame"] = spec["last_frame"]
    if spec["labels"]:
        _write(folder / LABELS, _table(("camera", "frame", "marker", "x_px", "y_px"), spec["labels"]))
        data["labels"] = LABELS
    path = folder / DESCRIPTION
    _write(path, write_yaml(data))
    return path


def _write(path: Path, text: str) -> None:
    with private_files.open_new(path) as stream:
        stream.write(text.encode())


def _film(path: str, rate_hz: float | None) -> dict[str, Any]:
    return {"path": path} if rate_hz is None else {"path": path, "rate_hz": Decimal(repr(rate_hz))}


def _table(columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> str:
    """Return ``rows`` as CSV, numbers in full precision."""
    text = io.StringIO()
    table = csv.writer(text)
    table.writerow(columns)
    table.writerows(
        [repr(value) if isinstance(value, float) else value for value in map(row.get, columns)] for row in rows
    )
    return text.getvalue()
