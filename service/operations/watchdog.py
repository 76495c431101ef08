"""A separate process that kills the server if the server does not end after a signal to stop.

It is needed when no thread of the server can run Python, because one of them holds the interpreter lock for ever. The
server starts this file by its path, without the package, so that it starts in milliseconds and takes few megabytes. Its
standard input is a pipe from the server: any byte means that a signal has arrived; the end of the pipe means that the
server has ended, and then this process ends as well.

    python -I -S watchdog.py PID SECONDS
"""

from __future__ import annotations

import os
import select
import signal
import sys
import time
from contextlib import suppress

# On this signal the server writes the stacks of all its threads to its standard error.
STACKS = signal.SIGUSR1
STACKS_SECONDS = 1.0
CHUNK = 65536


def main(server: int, seconds: float) -> None:
    """Wait for a signal to stop, then ``seconds`` for the process with id ``server`` to end, then kill it."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # also sent to this process, by a service manager or a terminal
    if not os.read(0, CHUNK) or ended(server, seconds):
        return
    say(f"wingfit: process {server} has not ended {seconds:g} s after the signal to stop, and is killed; its threads:")
    os.kill(server, STACKS)
    if not ended(server, STACKS_SECONDS):
        os.kill(server, signal.SIGKILL)


def ended(server: int, seconds: float) -> bool:
    """Wait up to ``seconds`` for the process with id ``server`` to end; return whether it ended."""
    deadline = time.monotonic() + seconds
    while (left := deadline - time.monotonic()) > 0:
        if select.select([0], [], [], left)[0] and not os.read(0, CHUNK):
            return True
    return os.getppid() != server


def say(line: str) -> None:
    """Write a line to the server's log."""
    with suppress(OSError):  # nobody reads the log any more; killing is what matters
        os.write(2, f"{line}\n".encode())


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]))
