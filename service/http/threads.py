"""Daemon threads for one call each. Unlike a thread pool they cannot be exhausted, and the exit waits for none."""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Generic, TypeVar

LOG = logging.getLogger("wingfit")

Result = TypeVar("Result")


def call(name: str, function: Callable[[], Result]) -> Future[Result]:
    """Call ``function`` in a new thread called ``name``; return the future of its result."""
    future: Future[Result] = Future()
    future.set_running_or_notify_cancel()  # so that cancelling the future does not lose the result

    def run() -> None:
        try:
            result = function()
        except BaseException as error:
            future.set_exception(error)
        else:
            future.set_result(result)

    threading.Thread(target=run, name=name, daemon=True).start()
    return future


def done_within(seconds: float, name: str, function: Callable[[], object]) -> bool:
    """Whether ``function`` returns within ``seconds``, and not False; a longer call continues in its thread."""
    try:
        return call(name, function).result(seconds) is not False
    except TimeoutError:
        return False
    except Exception:
        LOG.exception("%s failed", name)
        return False


class SharedCall(Generic[Result]):
    """A function called in a thread; all who wait at the same time share one call."""

    def __init__(self, name: str, function: Callable[[], Result]) -> None:
        self._name, self._function = name, function
        self._future: Future[Result] | None = None
        self._start = 0.0

    async def result(self, seconds: float) -> Result:
        """The result of the function; TimeoutError once its call lasts longer than ``seconds``.

        To be awaited in one event loop only.
        """
        if self._future is None or self._future.done():
            self._start, self._future = time.monotonic(), call(self._name, self._function)
        left = max(0.0, self._start + seconds - time.monotonic())
        return await asyncio.wait_for(asyncio.wrap_future(self._future), left)
