"""Stops the server in bounded time: what has not ended in time is abandoned, and the log names it.

Three mechanisms end the process, each in case the one before hangs: the graceful stop
(:meth:`wingfit.service.container.Service.stop`), whose steps have time limits; a thread (:class:`Deadline`) that exits
the process; and another process (:mod:`wingfit.service.operations.watchdog`) that kills this one when no thread can run
Python.
"""

from __future__ import annotations

import faulthandler
import logging
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import NoReturn

from wingfit.service.http import threads
from wingfit.service.operations import watchdog

LOG = logging.getLogger("wingfit")
SIGNALS = (signal.SIGINT, signal.SIGTERM)
REPORT_SECONDS = 2.0  # time to log what is given up
JOIN_SECONDS = 1.0  # time for threads to end after the stop
FRAMES = 3
DEADLINE = "stop-deadline"


@dataclass(frozen=True)
class StopLimits:
    """Time limits of the stop, in seconds; the first four apply one after the other.

    Attributes:
        requests: for open requests to be answered.
        jobs: for jobs to store their present step.
        evaluator: for the evaluator to stop its workers.
        database: for a write to end.
        give_up: from the signal until the process exits regardless; more than the four above together.
        kill: from the signal until the process is killed; less than service managers and containers wait (mostly 30 s).
    """

    requests: int = 2
    jobs: float = 3.0
    evaluator: float = 5.0
    database: float = 2.0
    give_up: float = 15.0
    kill: float = 25.0


class Deadline:
    """Thread that ends the process ``seconds`` after the first signal to stop.

    ``unfinished()`` gives a line for the log about each request and job that is running then.
    """

    def __init__(self, unfinished: Callable[[], Iterable[str]], seconds: float) -> None:
        self._unfinished, self._seconds = unfinished, seconds
        # SimpleQueue.put is reentrant, so that a second signal may interrupt it; other ways to wake a thread are not.
        self._signals: queue.SimpleQueue[None] = queue.SimpleQueue()
        threading.Thread(target=self._wait, name=DEADLINE, daemon=True).start()

    def begin(self) -> None:
        """Start to count the time, at a signal to stop. May be called in a signal handler."""
        self._signals.put(None)

    def _wait(self) -> None:
        self._signals.get()
        time.sleep(self._seconds)
        threads.done_within(REPORT_SECONDS, "stop-report", self._report)
        leave()

    def _report(self) -> None:
        LOG.warning("the stop takes longer than %g s; the following is given up:", self._seconds)
        for line in self._unfinished():
            LOG.warning("given up: %s", line)
        log_threads()


def leave() -> NoReturn:
    """End the process with status 0 without waiting for any thread; nothing that was acknowledged as stored is lost."""
    threads.done_within(REPORT_SECONDS, "stop-log", logging.shutdown)
    os._exit(0)


def held_up() -> bool:
    """Wait up to JOIN_SECONDS for the threads that a normal exit waits for; return whether one of them still runs."""
    deadline = time.monotonic() + JOIN_SECONDS
    own = threading.current_thread()
    waited_for = [one for one in threading.enumerate() if one is not own and not one.daemon]
    for thread in waited_for:
        thread.join(max(0.0, deadline - time.monotonic()))
    return any(thread.is_alive() for thread in waited_for)


def log_threads() -> None:
    """Log every other living thread with the lines that it is executing."""
    for line in _threads():
        LOG.warning("given up: %s", line)


def _threads() -> Iterator[str]:
    frames, own = sys._current_frames(), threading.get_ident()
    for thread in threading.enumerate():
        frame = frames.get(thread.ident or 0)
        if frame is not None and thread.ident != own and thread.name != DEADLINE:
            yield f"thread {thread.name!r} at {' < '.join(_stack_lines(frame))}"


def _stack_lines(frame: FrameType | None) -> Iterator[str]:
    """Yield file, line and function of the ``FRAMES`` innermost calls of a stack, innermost first."""
    for _ in range(FRAMES):
        if frame is None:
            return
        code = frame.f_code
        yield f"{code.co_filename}:{frame.f_lineno} ({code.co_name})"
        frame = frame.f_back


class Watchdog:
    """Starts a process that kills the server ``seconds`` after a signal to stop, even if no thread can run Python.

    Python's signal handlers need the interpreter; faulthandler's handler does not, and writes into a pipe to the
    watchdog process as soon as the signal arrives. If that process cannot be started, the server works without it.
    """

    def __init__(self, seconds: float) -> None:
        reading, self._alarm = os.pipe()  # not inherited, so that the end of the server ends the pipe
        os.set_blocking(self._alarm, False)
        command = [sys.executable, "-I", "-S", str(Path(watchdog.__file__)), str(os.getpid()), f"{seconds:g}"]
        try:
            self._process = subprocess.Popen(  # noqa: S603  # this program
                command, stdin=reading, stdout=subprocess.DEVNULL, start_new_session=True, cwd="/"
            )
        except OSError as error:
            LOG.warning("the watchdog cannot start (%s); nothing kills this process if it hangs while it stops", error)
        finally:
            os.close(reading)
        with suppress(OSError, ValueError, AttributeError):  # standard error is not a file
            faulthandler.register(watchdog.STACKS, file=sys.stderr, all_threads=True)

    def listen(self) -> None:
        """Make faulthandler handle the stop signals before their present handlers; call again when these change."""
        for number in SIGNALS:
            faulthandler.unregister(number)
            # Only the stack of the thread that takes the signal: reading the others while they run is not safe.
            faulthandler.register(number, file=self._alarm, all_threads=False, chain=True)
