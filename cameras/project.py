"""The description of what is filmed: ``film.yaml``, with cameras, films, markers and light."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np

from wingfit.cameras.files.keys import mapping_at, value_at
from wingfit.cameras.files.read import read_cameras
from wingfit.cameras.track.film_detections import Light, MarkerKind
from wingfit.cameras.track.labels import Label, read_labels
from wingfit.cameras.track.procedure import Request
from wingfit.cameras.track.reference import LEAST_MARKERS
from wingfit.cameras.video.source import Film, same_film
from wingfit.records.array_types import Array
from wingfit.records.description.wing_description import read_wing
from wingfit.records.description.yaml_text import Document, read_yaml
from wingfit.records.errors import check_most, fail, nearest, shown
from wingfit.records.files.number_table import read_table
from wingfit.records.limits import MAX_DESCRIPTION_BYTES, MIB

FORMAT, VERSION = "wingfit film", 1
MOST_CAMERAS = 8
MOST_WITHIN_MS = 1000.0
LEAST_APART_M = 1e-5  # two markers
_KEYS = ("format", "version", "cameras", "films", "markers", "light")
_OPTIONAL = ("clocks_within_ms", "first_frame", "last_frame", "labels")


def read_film(path: Path, store: Path | None = None) -> Request:
    """Return what ``film.yaml`` at ``path`` describes; paths in it count from its folder.

    ``store`` is the folder for what is detected. DatasetError names line, value and remedy.
    """
    document = _document(path)
    data = mapping_at(document, (), _KEYS, _OPTIONAL)
    if data["format"] != FORMAT or data["version"] != VERSION:
        value = f"{data['format']} {data['version']}"
        raise fail(document.where(("format",)), value, f"{value!r} is not {FORMAT!r} version {VERSION}")
    return _Reader(document, data, path.parent).request(store)


@dataclass(frozen=True)
class _Reader:
    document: Document
    data: Mapping[str, Any]
    folder: Path

    def request(self, store: Path | None) -> Request:
        described = read_cameras(self._file(("cameras",)))
        films = self._films([camera.name for camera in described.cameras])
        cameras = tuple(camera for camera in described.cameras if camera.name in films)
        covariance = described.covariance
        if covariance is not None:
            sizes = [len(camera.parameter_names) for camera in described.cameras]
            used = np.repeat([camera.name in films for camera in described.cameras], sizes)
            covariance = covariance[np.ix_(used, used)]
        markers = mapping_at(self.document, ("markers",), ("kind",), ("wing", "places"))
        names, places = self._places(markers)
        light: Light = self._choice(("light",), get_args(Light))
        within = self._number(("clocks_within_ms",), 0.0, MOST_WITHIN_MS, 0.0)
        if within and light == "strobe":
            where = self.document.where(("clocks_within_ms",))
            raise fail(where, within, "with a strobe, its flashes show the clocks; leave the key out")
        first = self._frame(("first_frame",), 0) or 0
        last = self._frame(("last_frame",), first + 1, "the film is used up to this frame, which is not included")
        return Request(
            cameras=cameras,
            films=tuple(films[camera.name] for camera in cameras),
            kind=self._choice(("markers", "kind"), get_args(MarkerKind)),
            light=light,
            names=names,
            reference=places,
            calibration=covariance,
            within_s=within / 1000,
            first=first,
            last=last,
            store=store,
            labels=self._labels(),
        )

    def _films(self, cameras: list[str]) -> dict[str, Film]:
        films = mapping_at(self.document, ("films",), (), tuple(cameras))
        if not 2 <= len(films) <= MOST_CAMERAS:
            where = self.document.where(("films",))
            raise fail(where, len(films), f"{len(films)} films; tracks in space take 2 to {MOST_CAMERAS} cameras")
        found = dict[str, Film]()
        for name in films:
            mapping_at(self.document, ("films", name), ("path",), ("rate_hz",))
            rate = self._number(("films", name, "rate_hz"), 1e-3, 1e6, 0.0)
            film = Film(self._file(("films", name, "path")), rate or None)
            same = next((other for other, one in found.items() if same_film(one.path, film.path)), None)
            if same is not None:
                where = self.document.where(("films", name, "path"))
                message = (
                    f"camera {name!r} has the film of camera {same!r}, or a copy of it; each has a film of its own"
                )
                raise fail(where, name, message)
            found[name] = film
        return found

    def _places(self, markers: Mapping[str, Any]) -> tuple[tuple[str, ...], Array | None]:
        """Return names and places [K, 3] of the markers, from a wing or a table; none if neither is given."""
        if "wing" in markers and "places" in markers:
            raise fail(self.document.where(("markers",)), None, "has both 'wing' and 'places'; keep one")
        if "wing" in markers:
            wing = read_wing(self._file(("markers", "wing")))
            names, places = tuple(one.name for one in wing.markers), np.array([one.position for one in wing.markers])
        elif "places" in markers:
            path = self._file(("markers", "places"))
            table = read_table(_bytes(path), path.name, "marker")
            names, places = table.labels, np.stack([table.column(f"{axis}_m") for axis in "xyz"], axis=1)
        else:
            return (), None
        where = self.document.where(("markers",))
        if len(names) < LEAST_MARKERS:
            raise fail(where, len(names), f"{len(names)} markers; at least {LEAST_MARKERS} are needed")
        wrong = [name for name, place in zip(names, places, strict=True) if not np.isfinite(place).all()]
        if wrong:
            raise fail(where, wrong[0], f"marker {wrong[0]!r} has no place; give its x, y and z in metres")
        twice = [name for name in names if names.count(name) > 1 or not name]
        if twice:
            raise fail(where, twice[0], f"two markers have the name {twice[0]!r}; give each a name of its own")
        apart = np.linalg.norm(places[:, None] - places[None], axis=2) + np.diag(np.full(len(places), np.inf))
        if not apart.min() > LEAST_APART_M:
            one, two = sorted(np.unravel_index(int(np.argmin(apart)), apart.shape))
            message = f"the markers {names[one]!r} and {names[two]!r} have one place; give each its own, in metres"
            raise fail(where, names[two], message)
        size = float(np.linalg.norm(np.ptp(places, axis=0)))
        if not 1e-3 < size < 20:
            raise fail(where, f"{size:g}", f"the markers extend over {size:g} m; give their places in metres")
        return names, places

    def _labels(self) -> tuple[Label, ...]:
        if "labels" not in self.data:
            return ()
        path = self._file(("labels",))
        return read_labels(_bytes(path), path.name)

    def _file(self, path: tuple[str, ...]) -> Path:
        value = value_at(self.document, path)
        if not isinstance(value, str) or not value:
            raise fail(self.document.where(path), value, f"{shown(value)} is no path; state that of a file or folder")
        found = self.folder / value
        try:
            there = found.exists()
        except OSError as error:  # a name that is too long
            raise fail(self.document.where(path), value, f"cannot be read: {error.strerror}; check the path") from None
        if not there:
            raise fail(
                self.document.where(path), value, f"there is no {found}; paths count from the folder of film.yaml"
            )
        return found

    def _choice(self, path: tuple[str, ...], of: tuple[Any, ...]) -> Any:
        value = value_at(self.document, path)
        if value not in of:
            raise fail(self.document.where(path), value, f"{shown(value)!r}; {nearest(str(value), of)}")
        return value

    def _number(self, path: tuple[str, ...], low: float, high: float, default: float, meaning: str = "") -> float:
        value = value_at(self.document, path)
        if value is None:
            return default
        # Decimal is what the reader of YAML makes of numbers with a point; true and false are no numbers.
        number = float("nan") if isinstance(value, (bool, str, list, dict)) else float(value)
        if not low <= number <= high:
            message = f"{shown(value)}; it must be a number from {low:g} to {high:g}"
            raise fail(self.document.where(path), value, message + (f"; {meaning}" if meaning else ""))
        return number

    def _frame(self, path: tuple[str, ...], low: int, meaning: str = "") -> int | None:
        number = self._number(path, low, 10**9, -1, meaning)
        if number != int(number):
            raise fail(self.document.where(path), number, f"{number:g} is no whole number; frames are counted from 0")
        return int(number) if number >= 0 else None


def _document(path: Path) -> Document:
    raw = _bytes(path)
    limit = MAX_DESCRIPTION_BYTES / MIB
    check_most(path.name, "has", len(raw) / MIB, limit, "MiB", "a description of films is short; check the path")
    return read_yaml(raw, path.name)


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise fail(str(path), None, f"cannot be read: {error.strerror or error}; check the path") from None
