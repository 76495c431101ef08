"""From films to tracks: detect, bring to common instants, find which point is which marker, triangulate, reject."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from wingfit.cameras.camera import Camera
from wingfit.cameras.computed import Computed
from wingfit.cameras.markers.orientation import between_markers
from wingfit.cameras.places import from_calibration, pixel_error, residuals
from wingfit.cameras.track.cloud import Cloud, possible_points
from wingfit.cameras.track.film_detections import FilmDetections, FilmTask, Light, MarkerKind, detect_film
from wingfit.cameras.track.follow import Followed, follow
from wingfit.cameras.track.instants import Instants, flash_instants, frame_instants
from wingfit.cameras.track.labelled import Labelled, Starts
from wingfit.cameras.track.labels import LEAST_LABELLED, Label, check_frames, check_labels, spots
from wingfit.cameras.track.outliers import jumps
from wingfit.cameras.track.reference import LEAST_MARKERS, reference_of
from wingfit.cameras.track.registration import looks_alike, spacing, surface_of
from wingfit.cameras.track.result import TrackedFilm
from wingfit.cameras.triangulation import triangulate
from wingfit.cameras.video.source import Film, Frames
from wingfit.records.array_types import Array, Float
from wingfit.records.blas_threads import one_blas_thread
from wingfit.records.errors import counted, fail

Report = Callable[[str, float], object]


def _silent(step: str, part: float) -> None:
    pass


TOLERANCE_PX = 0.3
"""Error of the calibration (standard deviation) that the search for meeting rays allows."""
MOST_PLACES = 20_000_000  # instants times markers
Names = tuple[str, ...]
Places = Float[Array, "K 3"]
_ROUNDED = 0.01  # of a frame, in the stated time of a row and the rate
_JUMP = 0.05  # of the distance between neighbouring markers
_LENGTH_OFF = 0.01  # of the longest film
_SHOWN = 12  # instants of which the points are counted for a message
_UNLIKELY = 15.1  # chi-square with one degree of freedom, 99.99 %


@dataclass(frozen=True, eq=False)
class Request:
    """What is tracked.

    Attributes:
        cameras: calibrated.
        films: of each camera, in the same order.
        kind: of the markers.
        light: a strobe in the dark, or light that is always there.
        names: of the markers; empty if their places on the wing are not known.
        reference: [K, 3] (m), places of the markers on the wing, in any axes.
        calibration: covariance of the cameras' parameters, if known.
        within_s: the clocks of cameras without strobe may be so far apart; zero if they are synchronised.
        first, last: frames that are used, of each film; ``last`` is not among them, and None is the end.
        store: folder for what is detected, so that an interrupted run can go on; None: one that is removed at the end.
        labels: markers that a person named, at one instant or more; there the wing is not sought.
    """

    cameras: tuple[Camera, ...]
    films: tuple[Film, ...]
    kind: MarkerKind
    light: Light
    names: tuple[str, ...] = ()
    reference: Float[Array, "K 3"] | None = None
    calibration: Float[Array, "P P"] | None = None
    within_s: float = 0.0
    first: int = 0
    last: int | None = None
    store: Path | None = None
    labels: tuple[Label, ...] = ()


@one_blas_thread
def track(request: Request, report: Report = _silent) -> TrackedFilm:
    """Track the markers of a wing; ``report`` is called with what is being done, and how much of it is done (0 to 1).

    Raises:
        DatasetError: a film cannot be read, the cameras do not see the wing at the same instants, or the markers are
            not identified.
    """
    films = [film.opened() for film in request.films]
    _check(request, films)
    folder = TemporaryDirectory(prefix="wingfit-") if request.store is None else nullcontext(request.store)
    with folder as store:
        return _tracked(request, films, _detected(request, Path(store), report), report)


def _tracked(request: Request, films: Sequence[Frames], found: Sequence[FilmDetections], report: Report) -> TrackedFilm:
    """Track what is ``found`` in each film; what is detected and possible is read instant by instant."""
    report("instants", 0.0)
    named = spots(request.labels, request.cameras, found, request.light)
    if request.light == "strobe":
        instants = flash_instants(request.cameras, films, found, TOLERANCE_PX, named)
    else:
        instants = frame_instants(request.cameras, films, found, TOLERANCE_PX, request.within_s, named)
    seen = instants.seen
    clouds = Computed(
        len(seen), lambda number: possible_points(request.cameras, seen[number], TOLERANCE_PX, (0.0, np.inf))
    )
    report("rays", 0.0)
    names, reference, starts = _identified(request, instants, clouds, report)
    count = len(names) * len(clouds)
    if count > MOST_PLACES:
        what = f"{len(clouds)} instants of {len(names)} markers are {count} places"
        remedy = "track parts of the film, with first_frame and last_frame (not included)"
        raise fail("films", len(clouds), f"{what}; at most {MOST_PLACES} are tracked at once: {remedy}")
    surface, progress = surface_of(reference), lambda done, of: report("following", done / of)
    followed = follow(clouds, reference, surface, progress, starts, request.cameras)
    if followed is None:
        most = max(len(clouds[at]) for at in np.unique(np.linspace(0, len(clouds) - 1, _SHOWN).astype(int)))
        raise fail(
            "markers",
            most,
            f"at none of the instants tried do {LEAST_MARKERS} points agree with the described markers, of at most "
            f"{most} that two cameras see: check the calibration, the unit of the markers' places, and that all "
            "cameras show the same wing",
        )
    return _result(request, films, found, instants, followed, (names, reference))


def _detected(request: Request, store: Path, report: Report) -> list[FilmDetections]:
    """Detect the markers in all films at once, a thread for each; what is detected is in files in ``store``."""
    parts = [0.0] * len(request.films)

    def one(number: int) -> FilmDetections:
        task = FilmTask(request.films[number], request.kind, request.light, store, request.first, request.last)

        def progress(done: int, of: int) -> None:
            parts[number] = min(done / max(of, 1), 1.0)
            report("detecting", sum(parts) / len(parts))

        return detect_film(task, progress)

    with ThreadPoolExecutor(len(request.films)) as pool:
        found = list(pool.map(one, range(len(request.films))))
    for camera, of in zip(request.cameras, found, strict=True):
        most = max((len(seen) for seen in of.seen), default=0)
        if most < LEAST_MARKERS:
            raise fail(
                f"camera {camera.name}",
                most,
                f"at most {counted(most, 'marker')} in a frame; at least {LEAST_MARKERS} are needed: check kind and "
                "light of the project, and that markers are bright and 6 pixels wide or more",
            )
    return found


def _identified(
    request: Request, instants: Instants, clouds: Sequence[Cloud], report: Report
) -> tuple[Names, Places, Starts]:
    """Return names and places of the markers, and what they are at labelled instants.

    The places are the described ones, those of a labelled instant, or those of the instant that shows most of them.
    """
    if not request.labels:
        if request.reference is not None:
            return request.names, request.reference, {}
        return *reference_of(clouds, lambda done, of: report("rays", done / of)), {}
    labelled = Labelled(request.cameras, instants, clouds)
    points = labelled.points()
    if request.reference is None:
        names, places = labelled.reference(points)
    else:
        names, places = request.names, request.reference
    return names, places, labelled.starts(points, names, places)


def _check(request: Request, films: Sequence[Frames]) -> None:
    """Raise DatasetError for films or labels that do not fit, and for a layout that takes labels but has none."""
    for camera, film in zip(request.cameras, films, strict=True):
        _check_film(camera, film, request.first)
    check_labels(request.labels, request.cameras, request.names)
    check_frames(request.labels, request.cameras, films, (request.first, request.last))
    alike = looks_alike(request.reference) if request.reference is not None and not request.labels else None
    if alike is not None:
        one, two = (request.names[marker] for marker in alike)
        raise fail(
            "markers",
            one,
            f"the layout looks the same after a turn that takes {one!r} to the place of {two!r}: distances cannot tell "
            f"the markers apart. Label {LEAST_LABELLED} or more in one frame of each camera (labels: labels.csv)",
        )


def _check_film(camera: Camera, film: Frames, first: int) -> None:
    where = f"camera {camera.name}"
    if film.size_px != camera.size_px:
        filmed, stated = (" x ".join(map(str, size)) for size in (film.size_px, camera.size_px))
        message = (
            f"films {filmed} px and was calibrated at {stated} px: give the film in the size of the calibration, or "
            "calibrate with images of this size"
        )
        raise fail(where, filmed, message)
    readout = camera.row_s * film.size_px[1]
    if readout * film.rate_hz > 1 + _ROUNDED:
        message = (
            f"row_us {camera.row_s * 1e6:g} in the file of cameras makes {readout * 1e3:.4g} ms for "
            f"{film.size_px[1]} rows, more than a frame lasts: {1e3 / film.rate_hz:.4g} ms at {film.rate_hz:g} frames "
            "per second; correct row_us (microseconds), or rate_hz"
        )
        raise fail(where, f"{camera.row_s * 1e6:g}", message)
    if 0 < film.count <= first:
        message = f"the film has {film.count} frames, counted from 0; begin before its end"
        raise fail(f"first_frame, {where}", first, message)


def _result(
    request: Request,
    films: Sequence[Frames],
    found: Sequence[FilmDetections],
    instants: Instants,
    followed: Followed,
    markers: tuple[Names, Places],
) -> TrackedFilm:
    cameras, shape = request.cameras, followed.chosen.shape
    pixels, covariance = _observed(instants, followed)
    gaps = between_markers(followed.directions)
    pixels[:, gaps.ravel()] = np.nan
    error = pixel_error(cameras, pixels, covariance)
    covariance += error**2 * np.eye(2)
    points = triangulate(cameras, pixels, covariance)
    by_calibration = None
    if request.calibration is not None:
        by_calibration = from_calibration(cameras, points, pixels, covariance, request.calibration, shape[1])
    wrong = points.misfit > _UNLIKELY + 2.5 * (points.freedom - 1)
    points.positions[wrong] = np.nan
    places, spread = points.positions.reshape(*shape, 3), points.covariance.reshape(*shape, 3, 3)
    jumped = jumps(instants.times, places, spread, _JUMP * spacing(markers[1]))
    places[jumped] = np.nan
    spread[~np.isfinite(places).all(2)] = np.nan
    missed = residuals(cameras, pixels, points.positions)
    return TrackedFilm(
        names=markers[0],
        times=instants.times,
        positions=places,
        covariance=spread,
        by_calibration=by_calibration,
        pixels=np.moveaxis(pixels.reshape(-1, *shape, 2), 0, 1),
        residuals=np.moveaxis(missed.reshape(-1, *shape, 2), 0, 1),
        cameras=tuple(camera.name for camera in cameras),
        frames=instants.frames,
        pixel_error=error,
        rejected=gaps.sum(0) + wrong.reshape(shape).sum(0) + jumped.sum(0),
        bad_frames=tuple(of.bad_frames for of in found),
        remarks=(
            *instants.remarks,
            *_label_remarks(request, instants, followed, markers),
            *_remarks(request, films, found),
        ),
    )


def _observed(instants: Instants, followed: Followed) -> tuple[Float[Array, "C N 2"], Float[Array, "C N 2 2"]]:
    """Return the pixels of each marker in each camera at each instant, and their covariances."""
    count, cameras, markers = followed.detections.shape
    pixels = np.full((cameras, count, markers, 2), np.nan)
    covariance = np.empty((cameras, count, markers, 2, 2))
    covariance[:] = np.eye(2)
    for instant, seen in enumerate(instants.seen):
        for camera, one in enumerate(seen):
            index = followed.detections[instant, camera]
            have = index >= 0
            pixels[camera, instant, have] = one.pixels[index[have]]
            covariance[camera, instant, have] = one.covariance[index[have]]
    return pixels.reshape(cameras, -1, 2), covariance.reshape(cameras, -1, 2, 2)


def _label_remarks(
    request: Request, instants: Instants, followed: Followed, markers: tuple[Names, Places]
) -> list[str]:
    """Return remarks about names that labels of another instant contradict, or that nothing confirms."""
    cameras = [camera.name for camera in request.cameras]
    remarks = [
        f"at {instants.shown(instant, cameras)}, {', '.join(markers[0][one] for one in renamed[:5])} were followed to "
        "other points than those labelled: names between here and the labels before may be wrong; label a frame between"
        for instant, renamed in sorted(followed.renamed.items())
    ]
    if followed.again and looks_alike(markers[1]) is not None:
        lost = [instants.shown(instant, cameras) for instant in followed.again[:5]]
        remarks.append(
            f"the wing was lost and found again at {', '.join(lost)}: on this layout, which looks the same after a "
            "turn, names beyond are those of the smallest motion; label a frame there to be sure"
        )
    return remarks


def _remarks(request: Request, films: Sequence[Frames], found: Sequence[FilmDetections]) -> list[str]:
    """Return remarks about frames that could not be decoded, and about films that do not last equally long."""
    remarks = _lengths(request, films)
    for camera, film, of in zip(request.cameras, films, found, strict=True):
        if of.bad_frames:
            listed = f"{', '.join(map(str, of.bad_frames[:5]))}{', ...' if len(of.bad_frames) > 5 else ''}"
            count = counted(len(of.bad_frames), "frame")
            remarks.append(f"{count} of camera {camera.name} could not be decoded: {listed}")
        if of.ended is not None:
            remarks.append(
                f"the film of {camera.name} ends at frame {of.ended}, of {film.count} that its container states: the "
                "file is damaged or cut off; copy it again"
            )
    return remarks


def _lengths(request: Request, films: Sequence[Frames]) -> list[str]:
    seconds = [film.count / film.rate_hz for film in films]
    differ = max(seconds) - min(seconds) > max(_LENGTH_OFF * max(seconds), *(4 / film.rate_hz for film in films))
    if request.light == "strobe" or request.last is not None or not min(seconds) or not differ:
        return []
    each = ", ".join(f"{camera.name} {last:.4g} s" for camera, last in zip(request.cameras, seconds, strict=True))
    return [f"the films do not last equally long: {each}; what all cameras filmed is tracked. Check the frame rates"]
