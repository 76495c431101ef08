"""A process beside the server that kills it, if it does not end after a signal to stop.

The last resort, for when no thread of the server can run Python: one of them may hold the interpreter's lock for ever.
It runs this file by its path, without the package, so that it starts in milliseconds and takes few megabytes. Its
standard input is a pipe from the server. Whatever comes through it says that a signal has arrived; its end says that
the server has ended, however that happened, and then this process ends as well.

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
PIECE = 65536


def main(server: int, seconds: float) -> None:
    """Wait for the alarm, then ``seconds`` for the end of the process ``server``, then kill it."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # sent to all processes of a service, or of a terminal, at once
    if not os.read(0, PIECE) or ended(server, seconds):
        return
    say(f"wingfit: process {server} has not ended {seconds:g} s after the signal to stop, and is killed; its threads:")
    os.kill(server, STACKS)
    if not ended(server, STACKS_SECONDS):
        os.kill(server, signal.SIGKILL)


def ended(server: int, seconds: float) -> bool:
    """Whether the server has ended, within ``seconds``."""
    deadline = time.monotonic() + seconds
    while (left := deadline - time.monotonic()) > 0:
        if select.select([0], [], [], left)[0] and not os.read(0, PIECE):
            return True
    return os.getppid() != server


def say(line: str) -> None:
    """Write to the server's log, if somebody still takes it."""
    with suppress(OSError):  # what matters comes after it
        os.write(2, f"{line}\n".encode())


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]))
