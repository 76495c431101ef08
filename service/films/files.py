"""The files of films in the data folder, below ``films/``, which only the user who runs the server can read.

``films/fl_ID/videos/CAMERA.TOKEN`` is the video of a camera, ``videos/cameras.TOKEN`` the file of calibrated cameras.
Each upload has a token of its own, which the database names: a replaced file is complete before the row names it, and
what was detected in the old one is not taken for the new one. ``detected/`` holds what was detected, so that a tracking
goes on where it stopped, and ``tracked/tk_ID/`` the tracks.
"""

from __future__ import annotations

import asyncio
import os
import re
import secrets
import shutil
from collections.abc import AsyncIterator, Iterable
from pathlib import Path
from typing import IO, NamedTuple

from starlette.concurrency import run_in_threadpool

from wingfit.client import private_files
from wingfit.service.films.child import VIDEOS
from wingfit.service.http.problems import ProblemError
from wingfit.service.storage.disk_space import FULL

ROOT = "films"
PART, DELETED = ".part", "deleted-"
PIECE = 2**20
MIB = 2**20
RESERVED_MIB = 512  # of the disk, for the database
SILENT_SECONDS = 60.0  # a client that sends nothing for so long is given up

# The database may be a backup of a stranger, whose names must not lead out of the folder.
FILM, TRACKING = re.compile(r"fl_[0-9a-f]{16}"), re.compile(r"tk_[0-9a-f]{16}")
UPLOADED = re.compile(r"[A-Za-z0-9_-]{1,40}\.[0-9a-f]{8}")

CAMERAS = "cameras.yaml"
TRACKS, COVARIANCE, REPORT, RESULT = "tracks.csv", "covariance.npz", "report.html", "result.json"


class TrackingFiles(NamedTuple):
    """Files of one tracking that has succeeded: tracks (CSV), covariances (NumPy), and their cameras."""

    tracks: Path
    covariance: Path
    cameras: Path


class FilmFiles:
    """The folder ``films`` in the data folder ``data``."""

    def __init__(self, data: Path) -> None:
        self._root = data / ROOT

    @property
    def root(self) -> Path:
        """The folder of all films."""
        return self._root

    def folder(self, film_id: str) -> Path:
        """Return the folder of a film. This and the next raise ValueError for names that the server never makes."""
        return self._root / _name(FILM, film_id)

    def video(self, film_id: str, file: str) -> Path:
        """Return the path of an uploaded file of a film."""
        return self.folder(film_id) / VIDEOS / _name(UPLOADED, file)

    def detected(self, film_id: str) -> Path:
        """Return the folder of what was detected in a film."""
        return self.folder(film_id) / "detected"

    def tracked(self, film_id: str, tracking_id: str) -> Path:
        """Return the folder of the tracks of a tracking."""
        return self.folder(film_id) / "tracked" / _name(TRACKING, tracking_id)

    def new_folder(self, path: Path) -> Path:
        """Create ``path``, in the folder of a film, and its parents for this user alone; return it."""
        for one in (self._root, *reversed(path.relative_to(self._root).parents), path):
            private_files.make_folder(self._root / one)
        return path

    async def receive(self, film_id: str, name: str, body: AsyncIterator[bytes], size: int | None, most: int) -> Path:
        """Write an upload of ``body`` to a new file, which is complete when this returns; return its path.

        The file is a part until :meth:`complete` renames it, when it was checked. ``name``: of the camera, or
        "cameras"; ``size``: stated length in bytes, if any. Raises a 413 above ``most`` bytes, a 507 if the disk has no
        room, a 408 if the client sends nothing; then nothing is kept.
        """
        folder = await run_in_threadpool(self.new_folder, self.folder(film_id) / VIDEOS)
        part = folder / f"{name}.{secrets.token_hex(4)}{PART}"
        self._check_room(size or 0)
        try:
            with await run_in_threadpool(private_files.open_new, part) as stream:
                await self._write(stream, body, most)
        except OSError as error:
            await run_in_threadpool(part.unlink, missing_ok=True)
            if error.errno in FULL:
                raise self._full() from None
            raise
        except BaseException:  # also if the client is gone
            part.unlink(missing_ok=True)
            raise
        return part

    def complete(self, part: Path) -> Path:
        """Rename a received file that was checked; return its path."""
        return part.replace(part.with_suffix(""))

    async def _write(self, stream: IO[bytes], body: AsyncIterator[bytes], most: int) -> None:
        held, received, checked = bytearray(), 0, 0
        while (piece := await _next(body)) is not None:
            held += piece
            received += len(piece)
            if received > most:
                detail = f"the file is larger than {most / MIB:g} MiB (of a video: WINGFIT_MAX_FILM_MIB); send less"
                raise ProblemError(413, "too-large", detail)
            if len(held) >= PIECE:
                await run_in_threadpool(stream.write, bytes(held))
                held.clear()
            if received - checked > 64 * MIB:
                checked = received
                self._check_room(0)
        await run_in_threadpool(stream.write, bytes(held))
        await run_in_threadpool(_to_disk, stream)

    def _check_room(self, size: int) -> None:
        """Raise a 507 unless the disk has room for ``size`` bytes, and for the database beside it."""
        if shutil.disk_usage(self._root).free < size + RESERVED_MIB * MIB:
            raise self._full()

    def _full(self) -> ProblemError:
        return ProblemError(
            507,
            "disk-full",
            f"the disk of the server has no room for the file (at {self._root}; {RESERVED_MIB} MiB stay free for the "
            "database): free some space, or delete films that are not needed; then upload it again",
        )

    def keep_only(self, film_id: str, name: str, kept: str | None) -> list[Path]:
        """Remove the checked files of ``name`` but ``kept``, and what was detected in them; return what was removed."""
        files = (self.folder(film_id) / VIDEOS).glob(f"{name}.*")
        removed = [path for path in files if path.name != kept and path.suffix != PART]
        for path in removed:
            path.unlink(missing_ok=True)
        shutil.rmtree(self.detected(film_id), ignore_errors=True)
        return removed

    def set_aside(self, film_id: str) -> None:
        """Rename the folder of a film that is being deleted, which :meth:`remove` finishes."""
        if self.folder(film_id).exists():
            self.folder(film_id).replace(self._aside(film_id))

    def put_back(self, film_id: str) -> None:
        """Undo :meth:`set_aside`, because the deletion was not stored."""
        if self._aside(film_id).exists():
            self._aside(film_id).replace(self.folder(film_id))

    def remove(self, film_id: str) -> None:
        """Remove the folder that was set aside."""
        shutil.rmtree(self._aside(film_id), ignore_errors=True)

    def _aside(self, film_id: str) -> Path:
        return self._root / f"{DELETED}{_name(FILM, film_id)}"

    def forget_tracked(self, tracking_id: str) -> None:
        """Remove the tracks of a tracking that was deleted."""
        if TRACKING.fullmatch(tracking_id):
            for folder in self._root.glob(f"*/tracked/{tracking_id}"):
                shutil.rmtree(folder, ignore_errors=True)

    def tidy(self, known: Iterable[str]) -> list[str]:
        """Remove what a killed process left; return the names of folders of films that are not ``known``."""
        if not self._root.is_dir():
            return []
        films = set(known)
        for folder in self._root.glob(f"{DELETED}*"):
            film_id = folder.name.removeprefix(DELETED)
            if FILM.fullmatch(film_id):
                (self.put_back if film_id in films else self.remove)(film_id)
        for part in self._root.glob(f"*/{VIDEOS}/*{PART}"):
            part.unlink(missing_ok=True)
        return sorted(one.name for one in self._root.iterdir() if one.is_dir() and one.name not in films)


def _name(pattern: re.Pattern[str], name: str) -> str:
    if not pattern.fullmatch(name):
        raise ValueError(f"{name!a} names nothing that the server stores")
    return name


async def _next(body: AsyncIterator[bytes]) -> bytes | None:
    """Return the next piece of an upload, None at its end; raise a 408 if none comes."""
    try:
        return await asyncio.wait_for(anext(body, None), SILENT_SECONDS)
    except TimeoutError:
        detail = f"nothing was received for {SILENT_SECONDS:g} s; upload the file again"
        raise ProblemError(408, "timeout", detail) from None


def _to_disk(stream: IO[bytes]) -> None:
    stream.flush()
    os.fsync(stream.fileno())
