"""A stop that always ends: what is not done in time is given up, and the log says what.

Three things end the process, each for when the one before it hangs. The steps of the graceful stop
(:meth:`wingfit.service.container.Service.stop`) take bounded time. A thread that waits for the first signal
(:class:`Deadline`) exits the process. Another process (:mod:`wingfit.service.operations.watchdog`) kills this one when
no thread can run Python.
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
REPORT_SECONDS = 2.0  # for which the log may take a report of what is given up
LEAVE_SECONDS = 1.0  # for which threads that were let go may take to end
FRAMES = 3
DEADLINE = "stop-deadline"


@dataclass(frozen=True)
class StopLimits:
    """Seconds from the first signal, or from the end of the step before.

    Attributes:
        requests: that requests under way have to be answered.
        jobs: that jobs have to store the step under way.
        evaluator: that the evaluator has to stop its workers.
        database: that a write under way has to end.
        give_up: from the signal, after which the process exits whatever goes on: more than the steps take together.
        kill: from the signal, after which it is killed: less than service managers and containers wait, mostly 30 s.
    """

    requests: int = 2
    jobs: float = 3.0
    evaluator: float = 5.0
    database: float = 2.0
    give_up: float = 15.0
    kill: float = 25.0


class Deadline:
    """Exits ``seconds`` after the first signal; ``unfinished`` says what is under way then."""

    def __init__(self, unfinished: Callable[[], Iterable[str]], seconds: float) -> None:
        self._unfinished, self._seconds = unfinished, seconds
        # Its put may interrupt itself, as a second signal does; that of other ways to wake a thread may not.
        self._signals: queue.SimpleQueue[None] = queue.SimpleQueue()
        threading.Thread(target=self._wait, name=DEADLINE, daemon=True).start()

    def begin(self) -> None:
        """A signal has arrived. Safe in a signal handler."""
        self._signals.put(None)

    def _wait(self) -> None:
        self._signals.get()
        time.sleep(self._seconds)
        threads.done_within(REPORT_SECONDS, "stop-report", self._report)
        leave()

    def _report(self) -> bool:
        LOG.warning("the stop takes longer than %g s; given up is what goes on:", self._seconds)
        for line in self._unfinished():
            LOG.warning("given up: %s", line)
        log_threads()
        return True


def leave() -> NoReturn:
    """Exit at once, as after a clean stop: nothing that was acknowledged is lost, and no thread is waited for."""
    threads.done_within(REPORT_SECONDS, "stop-log", _flush)
    os._exit(0)


def held_up() -> bool:
    """Whether threads are left that an exit would wait for."""
    deadline = time.monotonic() + LEAVE_SECONDS
    own = threading.current_thread()
    waited_for = [one for one in threading.enumerate() if one is not own and not one.daemon]
    for thread in waited_for:
        thread.join(max(0.0, deadline - time.monotonic()))
    return any(thread.is_alive() for thread in waited_for)


def log_threads() -> None:
    """Log every other thread that is alive, with the line where it is."""
    for line in _threads():
        LOG.warning("given up: %s", line)


def _threads() -> Iterator[str]:
    frames, own = sys._current_frames(), threading.get_ident()
    for thread in threading.enumerate():
        frame = frames.get(thread.ident or 0)
        if frame is not None and thread.ident != own and thread.name != DEADLINE:
            yield f"thread {thread.name!r} at {' < '.join(_places(frame))}"


def _places(frame: FrameType | None) -> Iterator[str]:
    """The innermost first."""
    for _ in range(FRAMES):
        if frame is None:
            return
        code = frame.f_code
        yield f"{code.co_filename}:{frame.f_lineno} ({code.co_name})"
        frame = frame.f_back


def _flush() -> bool:
    logging.shutdown()
    return True


class Watchdog:
    """The process that kills this one ``seconds`` after a signal, even if no thread of it can run Python.

    It learns of the signal not by Python's own handler, which needs the interpreter, but by that of faulthandler, which
    writes into the pipe between both the instant the signal arrives. Without the process the server works as well.
    """

    def __init__(self, seconds: float) -> None:
        reading, self._alarm = os.pipe()  # neither end is inherited: the end of the server must be the end of the pipe
        os.set_blocking(self._alarm, False)
        command = [sys.executable, "-I", "-S", str(Path(watchdog.__file__)), str(os.getpid()), f"{seconds:g}"]
        try:
            self._process = subprocess.Popen(  # noqa: S603  # this program
                command, stdin=reading, stdout=subprocess.DEVNULL, start_new_session=True, cwd="/"
            )
        except OSError as error:
            LOG.warning("nothing ends this process if it hangs while it stops: %s", error)
        finally:
            os.close(reading)
        with suppress(OSError, ValueError, AttributeError):  # no standard error that is a file
            faulthandler.register(watchdog.STACKS, file=sys.stderr, all_threads=True)

    def listen(self) -> None:
        """Listen for the signals, before the handlers that are there now; again when these have changed."""
        for number in SIGNALS:
            faulthandler.unregister(number)
            # Of the thread that takes it only: to walk through the others while they run is for the last resort.
            faulthandler.register(number, file=self._alarm, all_threads=False, chain=True)
