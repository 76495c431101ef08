"""Ends this process when a unit takes too long, or when it is stopped: for workers whose owner cannot watch them.

A Ray worker is started by Ray, often on another machine, and a task that hangs would hold its processor for ever. So
each worker starts a small process of its own that needs nothing but the standard library. It is told when a unit
begins and how long it may take, hears a heartbeat in between, and kills its parent when the one takes too long or the
other stays away. Ray then notices the death, and the unit is done again. It ends with its parent.
"""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

BEAT_SECONDS = 5.0
# Kernels and libraries let other threads run within a fraction of a second.
SILENCE_SECONDS = 60.0

_SCRIPT = """
import os, select, signal, sys, time
silence, parent = float(sys.argv[1]), os.getppid()
heard = looked = time.monotonic()
deadline, rest = None, b""
while True:
    readable = select.select([0], [], [], 0.5)[0]
    now = time.monotonic()
    if now - looked > 5.0:  # this process was stopped itself, with all others: nobody is late
        heard, deadline = now, deadline and deadline + (now - looked)
    looked = now
    if readable:
        piece = os.read(0, 65536)
        if not piece:
            break
        heard = now
        *lines, rest = (rest + piece).split(b"\\n")
        for line in lines:
            if line == b"done":
                deadline = None
            elif line != b"alive":
                deadline = now + float(line)
    if now - heard > silence or (deadline is not None and now > deadline):
        if os.getppid() == parent:
            os.kill(parent, signal.SIGKILL)
        break
"""


class Guardian:
    """The small process, and our end of the pipe to it. For one unit at a time."""

    def __init__(self, silence_s: float = SILENCE_SECONDS, beat_s: float = BEAT_SECONDS) -> None:
        self._silence, self._beat = silence_s, beat_s
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        threading.Thread(target=self._live, name="heartbeat", daemon=True).start()

    @contextmanager
    def watching(self, limit_s: float) -> Iterator[None]:
        """Within the block this process is ended once ``limit_s`` have passed."""
        self._say(b"%f" % limit_s)
        try:
            yield
        finally:
            self._say(b"done")

    def _say(self, line: bytes) -> None:
        """Say it, to a new process where there is none or it ended; without one the work goes on unwatched."""
        with self._lock:
            for _ in range(2):  # it may end between the look and the word
                with suppress(OSError):
                    if self._process is None or self._process.poll() is not None:
                        self._process = self._started()
                    assert self._process.stdin is not None  # noqa: S101  # a pipe
                    self._process.stdin.write(line + b"\n")
                    return

    def _started(self) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-I", "-S", "-c", _SCRIPT, str(self._silence)]
        quiet = subprocess.DEVNULL
        return subprocess.Popen(  # noqa: S603  # our own words
            command, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet, bufsize=0, start_new_session=True
        )

    def _live(self) -> None:
        while True:
            time.sleep(self._beat)
            self._say(b"alive")
