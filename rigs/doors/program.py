"""A running program that gets requests on its standard input and answers on its standard output, within a time."""

from __future__ import annotations

import contextlib
import fcntl
import os
import selectors
import signal
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence

from wingfit.rigs.doors.door import DoorError, short

CHUNK = 1 << 16  # bytes
MOST_BYTES = 1 << 28  # of an answer
STDERR_BYTES = 4096  # of the end of the error output


class Late(Exception):  # noqa: N818  no error of the caller's
    """Raised where a program does not answer in time; the text is the end of its error output, after a colon."""


class Ended(Exception):  # noqa: N818
    """Raised where a program fails: exit code (negative: signal), and the end of its error output, after a colon."""

    def __init__(self, code: int, said: str) -> None:
        self.code, self.said = code, said
        how = f"exit code {code}"
        if code < 0:
            with contextlib.suppress(ValueError):
                how = f"signal {signal.Signals(-code).name}"
        super().__init__(how + said)


class Program:
    """A program that was started; the process group that it leads is killed with it."""

    def __init__(self, words: Sequence[str], folder: str | None, environment: Mapping[str, str]) -> None:
        self.requests, self.answered = 0, 0
        # A file and no pipe: whatever the program writes, it never waits for a reader.
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115  closed by kill
        fcntl.fcntl(self._errors, fcntl.F_SETFL, fcntl.fcntl(self._errors, fcntl.F_GETFL) | os.O_APPEND)
        try:
            self._process = subprocess.Popen(  # noqa: S603  the user's own words, without a shell
                list(words),
                bufsize=0,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                cwd=folder,
                env=dict(environment),
                start_new_session=True,
            )
        except BaseException:
            self._errors.close()
            raise
        assert self._process.stdin is not None  # noqa: S101  pipes
        assert self._process.stdout is not None  # noqa: S101
        self._in, self._out = self._process.stdin, self._process.stdout
        for pipe in (self._in, self._out):
            os.set_blocking(pipe.fileno(), False)
        self._owner = os.getpid()

    @property
    def waits(self) -> bool:
        """Whether it belongs to this process and has not failed; it waits for a request, then."""
        return self._owner == os.getpid() and self._process.poll() in (None, 0)

    def ask(self, request: str, timeout: float, one_line: bool) -> str:
        """Write ``request`` and return the answer: one line, or everything until the program ends.

        Raises Late after ``timeout`` (s), Ended where the program fails, DoorError where the answer is no text.
        """
        deadline = time.monotonic() + timeout
        self._errors.truncate(0)  # a program that lives long must not fill the disk
        answer = self._exchanged(request.encode(), deadline, one_line)
        if not one_line or not answer.endswith(b"\n"):
            self._waited(deadline)
            if self._process.returncode or one_line:
                raise Ended(self._process.returncode, self._said())
        self.answered = self.requests
        try:
            return answer.decode()
        except UnicodeDecodeError as error:
            raise DoorError(f"the answer of the program is not UTF-8: {error}; write numbers as text") from error

    def _exchanged(self, request: bytes, deadline: float, one_line: bool) -> bytes:
        """Write ``request`` while reading, so that neither side waits for the other."""
        left, answer = memoryview(request), bytearray()
        with selectors.DefaultSelector() as selector:
            selector.register(self._in, selectors.EVENT_WRITE)
            selector.register(self._out, selectors.EVENT_READ)
            while True:
                ready = selector.select(max(deadline - time.monotonic(), 0.0))
                if not ready and time.monotonic() >= deadline:
                    raise Late(self._said())
                for key, _ in ready:
                    if key.fileobj is self._in:
                        left = self._written(left)
                        if not left:
                            selector.unregister(self._in)
                            if not one_line:
                                self._in.close()
                    elif self._read(answer) or (one_line and answer.endswith(b"\n")):
                        return bytes(answer)

    def _written(self, left: memoryview) -> memoryview:
        try:
            return left[os.write(self._in.fileno(), left[:CHUNK]) :]
        except BlockingIOError:
            return left
        except BrokenPipeError:  # it ended, or reads no input: its answer or exit code says more
            return left[:0]

    def _read(self, answer: bytearray) -> bool:
        """Add to ``answer`` what can be read; whether the output has ended."""
        try:
            part = os.read(self._out.fileno(), CHUNK)
        except BlockingIOError:
            return False
        answer += part
        if len(answer) > MOST_BYTES:
            raise DoorError(f"the program wrote more than {MOST_BYTES >> 20} MiB; write the channels asked for only")
        return not part

    def _waited(self, deadline: float) -> None:
        try:
            self._process.wait(max(deadline - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired as error:
            raise Late(self._said()) from error

    def _said(self) -> str:
        """Return the end of the error output, after a colon; "" if there is none."""
        size = self._errors.seek(0, os.SEEK_END)
        self._errors.seek(max(size - STDERR_BYTES, 0))
        text = short(self._errors.read().decode(errors="replace"), end=True)
        return f": {text}" if text else ""

    def kill(self) -> None:
        """Kill the program and what it started, and close the pipes; does nothing the second time."""
        if self._owner == os.getpid() and self._process.poll() is None:  # else: a copy in a forked process
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        for pipe in (self._in, self._out, self._errors):
            with contextlib.suppress(OSError):
                pipe.close()
