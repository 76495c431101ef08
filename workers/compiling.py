"""Compiles the simulator before the first worker starts: once for all of them, and with progress."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress

from wingfit.workers.share import child_environment

LOG = logging.getLogger("wingfit.workers")
LOOK_SECONDS = 0.2
COMMAND = "from wingfit.sim.warm import compile_kernels; compile_kernels(lambda part: print(part, flush=True))"


def compile_simulator(say: Callable[[str], None], stopped: Callable[[], bool]) -> None:
    """Compile what is not compiled yet, in a process of its own, and ``say`` how far it is.

    Ends soon after ``stopped()`` returns True. A failure of the process is only logged: the workers then compile for
    themselves. OSError if the process cannot be started.
    """
    from wingfit.sim.warm import compiled

    if compiled():
        return
    LOG.info("compiling the simulator, which takes a minute and is done once")
    with child_environment():
        process = subprocess.Popen([sys.executable, "-c", COMMAND], stdout=subprocess.PIPE)  # noqa: S603
    with process:
        if process.stdout is None:
            raise AssertionError("the process has a pipe")
        os.set_blocking(process.stdout.fileno(), False)
        began = time.monotonic()
        while process.poll() is None:
            if stopped():
                process.kill()
            elif part := _last_part(process.stdout.read() or b""):
                left = (time.monotonic() - began) * (1.0 - part) / part
                say(f"compiling the simulator, once: {part:.0%}, about {left:.0f} s left")
            time.sleep(LOOK_SECONDS)
    if process.returncode and not stopped():
        LOG.warning("compiling the simulator ended with %d; the workers compile for themselves", process.returncode)


def _last_part(output: bytes) -> float | None:
    """Return the last line of ``output`` that is a number in (0, 1]; None without one. Other lines are warnings."""
    part = None
    for line in output.splitlines():
        with suppress(ValueError):
            part = found if 0.0 < (found := float(line)) <= 1.0 else part
    return part
