"""Writes the description of films (``film.yaml``) that the tracking of a film reads, as 'wingfit track' does."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from decimal import Decimal
from pathlib import Path
from typing import Any

from wingfit.client import private_files
from wingfit.records.description.yaml_text import write_yaml
from wingfit.service.films.files import FilmFiles
from wingfit.service.films.requests import CALIBRATION
from wingfit.service.films.views import uploaded
from wingfit.service.storage.tables import FilmRow

DESCRIPTION, PLACES = "film.yaml", "markers.csv"


def write_description(folder: Path, row: FilmRow, spec: Mapping[str, Any], files: FilmFiles) -> Path:
    """Write ``film.yaml`` into ``folder``, with the places of the markers beside it; return its path.

    ``row``: the film, all of whose files are there; ``spec``: settings of a tracking.
    """
    named = {name: str(files.video(row.id, file).resolve()) for name, file in uploaded(row).items()}
    markers: dict[str, Any] = {"kind": spec["kind"]}
    if spec["places"]:
        _write(folder / PLACES, _table(spec["places"]))
        markers["places"] = PLACES
    data = {
        "format": "wingfit film",
        "version": 1,
        "cameras": named[CALIBRATION],
        "light": spec["light"],
        "films": {camera["name"]: _film(named[camera["name"]], camera["stated_rate_hz"]) for camera in row.cameras},
        "markers": markers,
        "clocks_within_ms": Decimal(repr(spec["clocks_within_ms"])),
        "first_frame": spec["first_frame"],
    }
    if spec["last_frame"] is not None:
        data["last_frame"] = spec["last_frame"]
    path = folder / DESCRIPTION
    _write(path, write_yaml(data))
    return path


def _write(path: Path, text: str) -> None:
    with private_files.open_new(path) as stream:
        stream.write(text.encode())


def _film(path: str, rate_hz: float | None) -> dict[str, Any]:
    return {"path": path} if rate_hz is None else {"path": path, "rate_hz": Decimal(repr(rate_hz))}


def _table(places: list[dict[str, Any]]) -> str:
    text = io.StringIO()
    rows = csv.writer(text)
    rows.writerow(["marker", "x_m", "y_m", "z_m"])
    rows.writerows([one["marker"], *(repr(float(one[f"{axis}_m"])) for axis in "xyz")] for one in places)
    return text.getvalue()
