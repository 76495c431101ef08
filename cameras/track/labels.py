"""Markers that a person named in some frames: what the table holds, and which detection each label means.

Distances between markers do not tell the markers of a symmetric layout apart. Labels do.
"""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from wingfit.cameras.camera import Camera
from wingfit.cameras.track.film_detections import FilmDetections, Light
from wingfit.cameras.video.source import Frames
from wingfit.records.errors import Faults, check_most, decode, fail, nearest

COLUMNS = ("camera", "frame", "marker", "x_px", "y_px")
LEAST_LABELLED = 6
"""Markers that two cameras must have at each labelled instant."""
FARTHEST_PX = 6.0
"""Largest distance from a label to its detection; that to the edge of the marker, if it is larger."""
MOST_LABELS = 100_000
_NAME = re.compile(r"[A-Za-z0-9_.-]{1,64}")
_MOST_DIGITS = 9


@dataclass(frozen=True)
class Label:
    """A marker that a person named.

    Attributes:
        camera: name of the camera.
        frame: of the film of this camera, counted from 0.
        marker: name of the marker.
        pixel: x and y of its centre.
        where: file and line of the label, for messages.
    """

    camera: str
    frame: int
    marker: str
    pixel: tuple[float, float]
    where: str = field(default="", compare=False)

    @property
    def place(self) -> str:
        """Return what messages call this label."""
        return self.where or f"label of {self.marker} in frame {self.frame} of {self.camera}"


@dataclass(frozen=True)
class Spot:
    """The detection that a label means: ``at`` is its instant in the detections of the camera with this number."""

    label: Label
    camera: int
    at: int
    detection: int


def read_labels(raw: bytes, file: str) -> tuple[Label, ...]:
    """Return the labels in a CSV table with the columns ``camera,frame,marker,x_px,y_px``.

    Raises:
        DatasetError: names line, value and remedy.
    """
    rows = csv.reader(io.StringIO(decode(raw, file), newline=""))
    header = [name.strip() for name in next(rows, [])]
    if header != list(COLUMNS):
        listed = ",".join(header)
        raise fail(f"{file}, line 1", listed, f"the header is {listed!r}; it must be {','.join(COLUMNS)!r}")
    labels, faults = list[Label](), Faults()
    for row in rows:
        if not any(cell.strip() for cell in row) or faults.full:
            continue
        where = f"{file}, line {rows.line_num}"
        check_most(where, "has", len(labels) + 1, MOST_LABELS, "labels", "label fewer frames")
        try:
            labels.append(_label([cell.strip() for cell in row], where))
        except ValueError as error:
            faults.add(where, None, str(error))
    faults.raise_any()
    if not labels:
        raise fail(file, 0, "holds no labels; leave the key 'labels' out, or add them")
    return tuple(labels)


def _label(cells: list[str], where: str) -> Label:
    """Return the label of one row; ValueError says what is wrong with it."""
    if len(cells) != len(COLUMNS):
        raise ValueError(f"has {len(cells)} cells; it must have {len(COLUMNS)}: {','.join(COLUMNS)}")
    camera, frame, marker, *place = cells
    if not (frame.isascii() and frame.isdigit() and len(frame) <= _MOST_DIGITS):
        raise ValueError(f"frame {frame[:40]!r} is no whole number; frames are counted from 0")
    pixel = []
    for name, cell in zip(COLUMNS[3:], place, strict=True):
        try:
            pixel.append(float(cell))
        except ValueError:
            pixel.append(np.nan)
        if not np.isfinite(pixel[-1]):
            raise ValueError(f"{name} is {cell[:40]!r}; it must be a number of pixels, with a decimal point")
    return Label(camera, int(frame), marker, (pixel[0], pixel[1]), where)


def check_labels(labels: Sequence[Label], cameras: Sequence[Camera], names: Sequence[str]) -> None:
    """Raise DatasetError for labels that no film can have; ``names`` are those of the markers, empty if unknown."""
    faults, sizes = Faults(), {camera.name: camera.size_px for camera in cameras}
    first: dict[tuple[str, int, str], Label] = {}
    for label in labels:
        if label.camera not in sizes:
            faults.add(label.place, label.camera, f"unknown camera {label.camera!r}; {nearest(label.camera, sizes)}")
            continue
        if names and label.marker not in names:
            faults.add(label.place, label.marker, f"unknown marker {label.marker!r}; {nearest(label.marker, names)}")
        elif not _NAME.fullmatch(label.marker) and not names:
            known = "1 to 64 letters, digits, or any of _ . -"
            faults.add(label.place, label.marker, f"{label.marker!r} is no name of a marker; give it {known}")
        limits = np.array(sizes[label.camera]) - 0.5
        if not all(-0.5 <= value <= most for value, most in zip(label.pixel, limits, strict=True)):
            width, height = sizes[label.camera]
            at = f"{label.pixel[0]:g}, {label.pixel[1]:g}"
            message = f"pixel ({at}) is outside the image of {width} x {height} px; count from the upper left pixel"
            faults.add(label.place, at, message)
        same = first.setdefault((label.camera, label.frame, label.marker), label)
        if same is not label:
            message = f"{label.marker!r} is labelled twice in frame {label.frame} of {label.camera}; keep one"
            faults.add(label.place, label.marker, f"{message} ({same.place} is the other)")
    faults.raise_any()
    seen = Counter(marker for marker, _ in {(label.marker, label.camera) for label in labels})
    shared = sum(count > 1 for count in seen.values())
    if labels and shared < LEAST_LABELLED:
        raise fail(labels[0].place.split(", line")[0], shared, too_few(shared, "in all frames together"))


def too_few(shared: int, where: str) -> str:
    """Return the message about too few markers that two cameras have."""
    return f"{shared} markers are labelled in two cameras {where}; label at least {LEAST_LABELLED}, each in two cameras"


def check_frames(
    labels: Sequence[Label], cameras: Sequence[Camera], films: Sequence[Frames], used: tuple[int, int | None]
) -> None:
    """Raise DatasetError for labels in frames beyond a film, or beyond those that are ``used`` (the last excluded)."""
    faults = Faults()
    ends = {camera.name: film.count for camera, film in zip(cameras, films, strict=True)}
    first, last = used
    for label in labels:
        end = min(ends[label.camera] or 10**_MOST_DIGITS, last or 10**_MOST_DIGITS)
        if not first <= label.frame < end:
            message = f"frame {label.frame} of {label.camera} is not among those used, {first} to {end - 1}"
            faults.add(label.place, label.frame, f"{message}; frames are counted from 0: label one of these")
    faults.raise_any()


def spots(
    labels: Sequence[Label], cameras: Sequence[Camera], found: Sequence[FilmDetections], light: Light
) -> list[Spot]:
    """Return the detections that the ``labels`` mean: the nearest one in the same frame.

    Raises:
        DatasetError: there is none within the limit, two labels mean the same, or the frame has no detections.
    """
    numbers = {camera.name: number for number, camera in enumerate(cameras)}
    if not labels:
        return []
    frames = [{mark.frame: at for at, mark in enumerate(of.marks)} for of in found]
    result, faults = list[Spot](), Faults()
    taken: dict[tuple[int, int, int], Label] = {}
    for label in labels:
        camera = numbers[label.camera]
        at = frames[camera].get(label.frame)
        if at is None and light == "strobe":  # a flash is also in the frame after its first
            at = frames[camera].get(label.frame - 1)
        if at is None:
            faults.add(label.place, label.frame, _no_instant(label, [*frames[camera]], light))
            continue
        seen = found[camera].seen[at]
        apart = np.linalg.norm(seen.pixels - np.array(label.pixel), axis=1)
        index = int(apart.argmin()) if len(apart) else -1
        limit = max(FARTHEST_PX, float(seen.size_px[index])) if index >= 0 else FARTHEST_PX
        if index < 0 or apart[index] > limit:
            what = f"the nearest detection is {apart[index]:.1f} px away" if index >= 0 else "nothing is detected there"
            message = f"{what}; at most {limit:.1f} px are allowed: correct the pixel, or remove the label"
            faults.add(label.place, label.marker, f"label of {label.marker!r}: {message}")
            continue
        other = taken.setdefault((camera, at, index), label)
        if other is not label:
            same = f"{other.marker!r} and {label.marker!r} are the same detection in frame {label.frame} of"
            faults.add(label.place, label.marker, f"labels of {same} {label.camera}; correct one of the pixels")
            continue
        result.append(Spot(label, camera, at, index))
    faults.raise_any()
    return result


def _no_instant(label: Label, frames: list[int], light: Light) -> str:
    what = "shows no flash" if light == "strobe" else "could not be decoded"
    near = f"; frame {min(frames, key=lambda one: abs(one - label.frame))} is the nearest to label" if frames else ""
    return f"frame {label.frame} of {label.camera} {what}{near}"
