"""Kills a Ray worker if one unit of its work exceeds the time limit, or if the worker process is suspended.

A Ray worker is started by Ray, often on another machine, where the evaluator cannot watch it; a hung task would block
its processor for ever. So each worker starts a small process that needs only the standard library. The worker sends to
this process the time limit of each unit, the end of each unit, and a regular heartbeat. If the limit passes or the
heartbeat stops, the small process kills the worker; Ray reports the death, and the evaluator repeats the unit. The
small process ends with the worker.
"""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

BEAT_SECONDS = 5.0
# Kernels and libraries release the interpreter lock within a fraction of a second.
SILENCE_SECONDS = 60.0

_SCRIPT = """
import os, select, signal, sys, time
silence, parent = float(sys.argv[1]), os.getppid()
heard = looked = time.monotonic()
deadline, rest = None, b""
while True:
    readable = select.select([0], [], [], 0.5)[0]
    now = time.monotonic()
    if now - looked > 5.0:  # this process was stopped too: extend the limits
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
    """Starts the small process that watches this one, and sends to it the start and the end of each unit of work.

    ``silence_s``: time without a heartbeat after which the small process kills this one; ``beat_s``: time between
    heartbeats.
    """

    def __init__(self, silence_s: float = SILENCE_SECONDS, beat_s: float = BEAT_SECONDS) -> None:
        self._silence, self._beat = silence_s, beat_s
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        threading.Thread(target=self._live, name="heartbeat", daemon=True).start()

    @contextmanager
    def watching(self, limit_s: float) -> Iterator[None]:
        """Have the small process kill this one if the with-block takes longer than ``limit_s`` (s)."""
        self._say(b"%f" % limit_s)
        try:
            yield
        finally:
            self._say(b"done")

    def _say(self, line: bytes) -> None:
        """Send ``line`` to the small process, restarted if it has ended; if that fails, there is no time limit."""
        with self._lock:
            for _ in range(2):  # it may end between the check and the write
                with suppress(OSError):
                    if self._process is None or self._process.poll() is not None:
                        self._process = self._started()
                    assert self._process.stdin is not None  # noqa: S101  # a pipe
                    self._process.stdin.write(line + b"\n")
                    return

    def _started(self) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-I", "-S", "-c", _SCRIPT, str(self._silence)]
        quiet = subprocess.DEVNULL
        return subprocess.Popen(  # noqa: S603  # our own arguments
            command, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet, bufsize=0, start_new_session=True
        )

    def _live(self) -> None:
        while True:
            time.sleep(self._beat)
            self._say(b"alive")
