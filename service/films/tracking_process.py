"""Process that tracks a film: ``python -m wingfit.service.films.tracking_process FILM_YAML STORE FOLDER``.

It writes the tracks into FOLDER, and a line of JSON for each report of progress to standard output: ``{"stage",
"progress"}``. If the film cannot be tracked, the last line is ``{"faults"}``, and the exit status is ``FAULTS``. The
process ends when standard input does, which its server holds open.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import threading
import time
from pathlib import Path
from typing import NoReturn

from wingfit.cameras.project import read_film
from wingfit.cameras.track.procedure import track
from wingfit.cameras.track.progress import whole
from wingfit.cameras.track.report import film_report
from wingfit.cameras.track.result import TrackedFilm
from wingfit.records.errors import DatasetError, fail
from wingfit.service.films.child import FAULTS, listed
from wingfit.service.films.files import COVARIANCE, REPORT, RESULT, TRACKS
from wingfit.service.films.summary import summary
from wingfit.service.storage.disk_space import FULL

REPORT_SECONDS = 0.2  # between two lines about one stage


def main(arguments: list[str]) -> None:
    """Track the film and write the files."""
    film, store, folder = (Path(one) for one in arguments)
    threading.Thread(target=_end_with_server, daemon=True).start()
    try:
        _write(_tracked(film, store), folder)
    except DatasetError as error:
        _refuse(error)
    except OSError as error:
        if error.errno not in FULL:
            raise
        message = "is full: free some space, and submit the tracking again; what was detected is kept"
        _refuse(fail("the disk of the server", None, message))


def _refuse(error: DatasetError) -> NoReturn:
    print(json.dumps({"faults": listed(error)}), flush=True)
    sys.exit(FAULTS)


def _write(found: TrackedFilm, folder: Path) -> None:
    """Write the files of the tracks; they are on the disk when this returns."""
    (folder / TRACKS).write_bytes(found.csv().encode())
    found.write_covariance(folder / COVARIANCE)
    (folder / REPORT).write_text(film_report(found), encoding="utf-8")
    (folder / RESULT).write_text(json.dumps(summary(found), allow_nan=False), encoding="utf-8")
    for name in (TRACKS, COVARIANCE, REPORT, RESULT):
        with (folder / name).open("rb") as file:
            os.fsync(file.fileno())


def _tracked(film: Path, store: Path) -> TrackedFilm:
    try:
        return track(read_film(film, store), _Lines())
    except DatasetError as error:
        if not Path(error.where).is_relative_to(store):
            raise
        shutil.rmtree(store)  # damaged, as when the machine stopped while it was written
        return track(read_film(film, store), _Lines())


class _Lines:
    """Prints progress, not more often than anybody can read."""

    def __init__(self) -> None:
        self._lock = threading.Lock()  # a thread for each film reports
        self._stage, self._at = "", 0.0

    def __call__(self, stage: str, part: float) -> None:
        with self._lock:
            if stage == self._stage and time.monotonic() - self._at < REPORT_SECONDS:
                return
            self._stage, self._at = stage, time.monotonic()
            print(json.dumps({"stage": stage, "progress": whole(stage, min(max(part, 0.0), 1.0))}), flush=True)


def _end_with_server() -> None:
    os.read(0, 1)  # not sys.stdin, which cannot be read at the end of the interpreter
    os._exit(1)


if __name__ == "__main__":
    main(sys.argv[1:])
