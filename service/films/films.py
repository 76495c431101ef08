"""Films as the routes use them: their rows in the database, their files, and the processes that read their videos."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session
from sqlalchemy.orm.attributes import flag_modified

from wingfit.cameras.files.camera_set import CameraSet
from wingfit.cameras.files.project import read_project
from wingfit.cameras.files.read import recognise
from wingfit.cameras.video.source import same_film
from wingfit.client.films import answers as a
from wingfit.records.errors import DatasetError, counted, fail
from wingfit.records.limits import MAX_DESCRIPTION_BYTES
from wingfit.service.films import views
from wingfit.service.films.containers import is_video
from wingfit.service.films.files import MIB, FilmFiles
from wingfit.service.films.requests import CALIBRATION
from wingfit.service.films.videos import Videos, VideoTimeoutError
from wingfit.service.http.problems import ProblemError, conflict, error_item, invalid, not_found
from wingfit.service.settings import Settings
from wingfit.service.storage import store
from wingfit.service.storage.database import Database
from wingfit.service.storage.tables import FilmRow, TrackingRow

LOG = logging.getLogger("wingfit")
FORMATS = {"opencv": "OpenCV", "anipose": "Anipose", "dlt": "DLT coefficients"}


class Films:
    """The films of the service."""

    def __init__(self, settings: Settings, database: Database) -> None:
        self._settings, self._database = settings, database
        self.files, self.videos = FilmFiles(settings.data), Videos()
        self._keeping = Lock()

    def start(self) -> None:
        """Remove what an earlier process left; warn of folders that belong to no film of the database."""
        with self._database.read() as session:
            known = session.scalars(select(FilmRow.id)).all()
        if unknown := self.files.tidy(known):
            place, named = self.files.root, ", ".join(unknown[:5])
            LOG.warning(
                "%d folders in %s belong to no film of the database: %s; delete them to free space",
                len(unknown),
                place,
                named,
            )

    def stop(self) -> None:
        """End the processes that read videos."""
        self.videos.close()

    def view(self, row: FilmRow) -> a.Film:
        """Return the JSON answer about the film in ``row``."""
        return views.film(row, self.files)

    def for_upload(self, film_id: str, name: str) -> tuple[FilmRow, int]:
        """Return the film that gets a file, and the most bytes that the file may have; errors as of a route."""
        with self._database.read() as session:
            row = store.one(session, FilmRow, film_id)
            _check_named(row, name)
            _check_idle(session, film_id)
            if name == CALIBRATION:
                return row, MAX_DESCRIPTION_BYTES
            require_opencv()
            self._check_share(session, row, name, 0)
        return row, self._settings.max_film_mib * MIB

    def _check_share(self, session: Session, row: FilmRow, name: str, size: int) -> None:
        """Raise a 429 if the owner has no room for a video ``name`` of ``size`` bytes, in place of the one before."""
        held = session.scalar(select(func.sum(FilmRow.size_bytes)).where(store.of_owner(FilmRow, row.owner))) or 0
        held -= next((camera["bytes"] or 0 for camera in row.cameras if camera["name"] == name), 0)
        most = self._settings.max_films_mib
        if held + max(size, 1) > most * MIB:
            raise ProblemError(
                429,
                "too-many",
                f"the videos of one owner may take {most} MiB (WINGFIT_MAX_FILMS_MIB); the others take "
                f"{held / MIB:.1f} MiB, this one {size / MIB:.1f} MiB more; delete films that are not needed",
            )

    def keep(self, film_id: str, name: str, part: Path) -> a.Film:
        """Check the uploaded file ``part``, make it the file ``name`` of a film, and return the film.

        Raises a 422 if the file is not valid, a 409 if the film is tracked; then the file is removed.
        """
        path = part
        try:
            facts = self._facts(film_id, name, part)
            # Of two uploads at once, the one that is stored last is kept, and only what it replaces is removed.
            with self._keeping:
                with self._database.write() as session:
                    row = store.one(session, FilmRow, film_id)
                    _check_idle(session, film_id)
                    self._check_sizes(row, name, part, facts)
                    if name != CALIBRATION:
                        self._check_share(session, row, name, part.stat().st_size)
                    path = self.files.complete(part)
                    _put(row, name, path, facts)
                removed = self.files.keep_only(film_id, name, path.name)
        except BaseException:
            self.videos.forget(part)
            path.unlink(missing_ok=True)
            raise
        for old in removed:
            self.videos.forget(old)
        return self.view(row)

    def _facts(self, film_id: str, name: str, path: Path) -> dict[str, Any]:
        with self._database.read() as session:
            row = store.one(session, FilmRow, film_id)
        try:
            if name == CALIBRATION:
                _check_has(row, read_calibration(path))
                return {}
            if not is_video(path):
                raise fail(
                    name, None, "is no video in a known container; upload AVI, MP4, MOV, MKV, WebM, MTS, WMV or MPEG"
                )
            self._check_own(row, name, path)
            return self.videos.facts(path, _camera_of(row, name)["stated_rate_hz"])
        except DatasetError as error:
            raise refused(f"the file {name} cannot be used", error, f"files.{name}") from None
        except VideoTimeoutError as error:
            raise invalid(str(error), [error_item(f"files.{name}", None, str(error))]) from None

    def _check_own(self, row: FilmRow, name: str, path: Path) -> None:
        """Raise DatasetError if the video ``path`` of camera ``name`` is that of another camera too."""
        for other, file in views.uploaded(row).items():
            video = self.files.video(row.id, file)
            if other not in (name, CALIBRATION) and video.is_file() and same_film(video, path):
                raise fail(name, None, f"is the video of camera {other!r} too; upload the one that this camera filmed")

    def _check_sizes(self, row: FilmRow, name: str, path: Path, facts: Mapping[str, Any]) -> None:
        """Raise a 422 if the images of a video have another size than its camera was calibrated with."""
        calibration = path
        if name != CALIBRATION:
            if row.calibration is None or not self.files.video(row.id, row.calibration).is_file():
                return
            calibration = self.files.video(row.id, row.calibration)
        sizes = {camera.name: camera.size_px for camera in read_calibration(calibration).cameras}
        for camera in row.cameras:
            known = facts if camera["name"] == name else camera
            if known.get("width_px") is None or camera["name"] not in sizes:
                continue
            size = (known["width_px"], known["height_px"])
            if size != tuple(sizes[camera["name"]]):
                stated = "{} x {}".format(*sizes[camera["name"]])
                message = (
                    f"camera {camera['name']} films {size[0]} x {size[1]} px and was calibrated at {stated} px: upload "
                    "the video in the size of the calibration, or calibrate with images of this size"
                )
                item = error_item(f"files.{name}", f"{size[0]} x {size[1]}", message)
                raise invalid(f"the file {name} does not fit the others", [item])

    def jpeg(self, film_id: str, camera: str, number: int, width_px: int | None) -> bytes:
        """Return frame ``number`` of a camera as JPEG; errors as of a route."""
        return self._ask(film_id, camera, do="jpeg", number=number, width_px=width_px)[1]

    def markers(self, film_id: str, camera: str, number: int, kind: str) -> a.FoundMarkers:
        """Return the markers that the detector sees in frame ``number`` of a camera; errors as of a route."""
        found: a.FoundMarkers = self._ask(film_id, camera, do="markers", number=number, kind=kind)[0]  # type: ignore[assignment]
        return found

    def tag(self, film_id: str, camera: str) -> str:
        """Return a text that differs for each video that a camera of a film had; a 404 if it has none."""
        return self._video(film_id, camera)[0].name

    def _video(self, film_id: str, camera: str) -> tuple[Path, float | None, int]:
        """Return path, stated rate and count of frames of a video; a 404 if there is none."""
        with self._database.read() as session:
            row = store.one(session, FilmRow, film_id)
        found = _camera_of(row, camera)
        path = self.files.video(film_id, found["file"]) if found["file"] else None
        if path is None or not path.is_file():
            raise not_found("video of camera", camera, f"upload it: PUT /v1/films/{film_id}/files/{camera}")
        return path, found["stated_rate_hz"], found["frames"]

    def _ask(self, film_id: str, camera: str, **request: Any) -> tuple[dict[str, Any], bytes]:
        require_opencv()
        path, rate_hz, _ = self._video(film_id, camera)
        try:
            answer, body = self.videos.ask(path, rate_hz, **request)
        except VideoTimeoutError as error:
            raise ProblemError(503, "busy", str(error)) from None
        except DatasetError as error:
            raise refused("the frame cannot be read", error, "path.number") from None
        if "count" in answer:
            raise not_found("frame", str(request["number"]), f"the film has {answer['count']}, counted from 0")
        return answer, body

    def delete(self, film_id: str) -> None:
        """Delete a film with its files; a 409 while trackings refer to it."""
        renamed = False
        try:
            with self._database.write() as session:
                row = store.one(session, FilmRow, film_id)
                count = session.scalar(select(func.count()).where(TrackingRow.film_id == film_id)) or 0
                if count:
                    raise store.in_use("film", film_id, counted(count, "tracking"), count)
                session.delete(row)
                session.flush()
                self.files.set_aside(film_id)
                renamed = True
        except BaseException:
            if renamed:
                self.files.put_back(film_id)
            raise
        self.videos.forget(self.files.folder(film_id))
        self.files.remove(film_id)


def require_opencv() -> None:
    """Raise a 501 if OpenCV, which reads videos, is not installed."""
    if find_spec("cv2") is None:
        raise ProblemError(
            501,
            "not-installed",
            "this server cannot read films: it has no OpenCV. On the server: pip install 'wingfit[cameras]'",
        )


def refused(detail: str, error: DatasetError, where: str) -> ProblemError:
    """Return a 422 with the faults of ``error``, at ``where`` in the request."""
    return invalid(detail, [error_item(where, fault.value, str(fault)) for fault in error.errors])


def read_calibration(path: Path) -> CameraSet:
    """Return the cameras in an uploaded file; DatasetError for a file of another program, and one that is not valid."""
    raw = path.read_bytes()
    if (found := recognise(raw, "cameras.yaml")) != "wingfit":
        message = f"is a file of {FORMATS[found]}; convert it: wingfit cameras convert FILE -o cameras.yaml"
        raise fail("cameras.yaml", None, message)
    return read_project(raw, "cameras.yaml")


def _check_has(row: FilmRow, found: CameraSet) -> None:
    names = [camera.name for camera in found.cameras]
    unknown = [camera["name"] for camera in row.cameras if camera["name"] not in names]
    if unknown:
        raise fail(
            "cameras.yaml",
            unknown[0],
            f"has no camera {unknown[0]!r}, but {', '.join(names)}; upload the file with all cameras of the film",
        )


def _check_named(row: FilmRow, name: str) -> None:
    if name != CALIBRATION:
        _camera_of(row, name)


def _camera_of(row: FilmRow, name: str) -> dict[str, Any]:
    found = next((camera for camera in row.cameras if camera["name"] == name), None)
    if found is None:
        names = ", ".join(camera["name"] for camera in row.cameras)
        raise not_found("camera", name, f"the film has {names}; the file of calibrated cameras is {CALIBRATION}")
    return found


def _check_idle(session: Session, film_id: str) -> None:
    """Raise a 409 while a tracking of the film has not ended."""
    busy = session.scalar(
        select(TrackingRow).where(TrackingRow.film_id == film_id, TrackingRow.state.in_(store.ACTIVE)).limit(1)
    )
    if busy is not None:
        raise conflict(
            f"tracking {busy.id} of the film is {busy.state}; wait for its end, or cancel it", state=busy.state
        )


def _put(row: FilmRow, name: str, path: Path, facts: Mapping[str, Any]) -> None:
    """Name the file ``path`` in the film ``row``."""
    if name == CALIBRATION:
        row.calibration = path.name
        return
    _camera_of(row, name).update(facts, file=path.name, bytes=path.stat().st_size)
    flag_modified(row, "cameras")
    row.size_bytes = sum(camera["bytes"] or 0 for camera in row.cameras)
