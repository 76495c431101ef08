"""Reads videos in processes of their own (:mod:`wingfit.service.films.video_process`), a few of which are kept."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import threading
import time
from collections import OrderedDict
from pathlib import Path
from typing import Any

from wingfit.records.errors import fail
from wingfit.service.films import child

MODULE = "wingfit.service.films.video_process"
MOST_PROCESSES = 4
SECONDS = 60.0  # for one answer; a late frame of a long film is reached by decoding those before it
PIECE = 2**20
MOST_BYTES = 64 * 2**20  # of one answer


class VideoTimeoutError(RuntimeError):
    """Raised if a frame is not read in time; the message says what to do."""


class _Process:
    """One process that reads one video."""

    def __init__(self, path: Path, rate_hz: float | None) -> None:
        self.lock = threading.Lock()
        self.users = 0  # threads that wait for it or use it
        self._path = path
        self._child = subprocess.Popen(  # noqa: S603  # fixed words and a path of this server
            child.command(MODULE, str(path), f"{rate_hz or 0.0!r}"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=child.environment(),
            start_new_session=True,
        )

    @property
    def lives(self) -> bool:
        return self._child.poll() is None

    def ask(self, request: dict[str, Any]) -> tuple[dict[str, Any], bytes]:
        """Return the answer to ``request``: JSON and bytes. DatasetError if the process dies of the video."""
        assert self._child.stdin is not None  # noqa: S101  # for the type checker
        deadline = time.monotonic() + SECONDS
        try:
            self._child.stdin.write(json.dumps(request).encode() + b"\n")
            self._child.stdin.flush()
            head, body = child.LENGTHS.unpack(self._read(child.LENGTHS.size, deadline))
            if head + body > MOST_BYTES:
                raise EOFError
            return json.loads(self._read(head, deadline)), self._read(body, deadline)
        except (EOFError, OSError, ValueError):
            self.close()
            status = self._child.returncode
            how = f"signal {signal.Signals(-status).name}" if status < 0 else f"status {status}"
            raise fail(
                self._path.name.split(".")[0],
                None,
                f"OpenCV fails on it ({how}); convert it, for example to MP4 with H.264",
            ) from None
        except VideoTimeoutError:
            self.close()
            raise

    def _read(self, size: int, deadline: float) -> bytes:
        assert self._child.stdout is not None  # noqa: S101
        read = bytearray()
        handle = self._child.stdout.fileno()
        while len(read) < size:
            left = deadline - time.monotonic()
            if left <= 0 or not select.select([handle], [], [], left)[0]:
                raise VideoTimeoutError(
                    f"the frame was not read within {SECONDS:g} s; ask for an earlier one, or convert the video to one "
                    "with fewer or smaller frames"
                )
            piece = os.read(handle, min(PIECE, size - len(read)))
            if not piece:
                raise EOFError
            read += piece
        return bytes(read)

    def close(self) -> None:
        self._child.kill()
        self._child.wait()
        for stream in (self._child.stdin, self._child.stdout):
            if stream is not None:
                try:
                    stream.close()
                except OSError:  # what was written is not flushed to a dead process
                    continue


class Videos:
    """Answers questions about videos; a process each of the latest videos stays for the next question."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._kept: OrderedDict[Path, _Process] = OrderedDict()

    def ask(self, path: Path, rate_hz: float | None, **request: Any) -> tuple[dict[str, Any], bytes]:
        """Return the answer of :mod:`wingfit.service.films.video_process` to ``request`` about the video ``path``.

        DatasetError if the video cannot be read, VideoTimeoutError if that takes too long.
        """
        process = self._process(path, rate_hz)
        try:
            with process.lock:
                answer, body = process.ask(request)
        finally:
            with self._lock:
                process.users -= 1
        if "faults" in answer:
            raise child.error_of(answer["faults"])
        return answer, body

    def facts(self, path: Path, rate_hz: float | None) -> dict[str, Any]:
        """Return ``frames``, ``width_px``, ``height_px`` and ``rate_hz`` of a video; errors as of :meth:`ask`."""
        try:
            return self.ask(path, rate_hz, do="facts")[0]
        finally:
            self.forget(path)

    def forget(self, path: Path) -> None:
        """End the process that reads ``path``, or whatever is below the folder ``path``."""
        with self._lock:
            ended = [self._kept.pop(one) for one in list(self._kept) if one == path or path in one.parents]
        for process in ended:
            process.close()

    def close(self) -> None:
        """End all processes."""
        with self._lock:
            ended = list(self._kept.values())
            self._kept.clear()
        for process in ended:
            process.close()

    def _process(self, path: Path, rate_hz: float | None) -> _Process:
        with self._lock:
            process = self._kept.pop(path, None)
            if process is None or not process.lives:
                process = _Process(path, rate_hz)
            process.users += 1
            self._kept[path] = process
            idle = [one for one, kept in self._kept.items() if not kept.users]
            ended = [self._kept.pop(one) for one in idle[: max(len(self._kept) - MOST_PROCESSES, 0)]]
        for old in ended:
            old.close()
        return process
