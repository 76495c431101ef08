"""Runs each call in a daemon thread of its own: never all busy like a pool, and not awaited when the process ends."""

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
    """Call ``function`` in a new daemon thread called ``name``; return the future of its result."""
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
    """Return whether ``function`` returns within ``seconds`` with another result than False.

    It runs in a thread called ``name``, where a longer call continues; an exception is logged and gives False.
    """
    try:
        return call(name, function).result(seconds) is not False
    except TimeoutError:
        return False
    except Exception:
        LOG.exception("%s failed", name)
        return False


class SharedCall(Generic[Result]):
    """Calls ``function`` in a thread; callers that wait at the same time share one call and its result."""

    def __init__(self, name: str, function: Callable[[], Result]) -> None:
        self._name, self._function = name, function
        self._future: Future[Result] | None = None
        self._start = 0.0

    async def result(self, seconds: float) -> Result:
        """Return the result of the function; raise TimeoutError once the call has lasted longer than ``seconds``.

        To be awaited in one event loop only.
        """
        if self._future is None or self._future.done():
            self._start, self._future = time.monotonic(), call(self._name, self._function)
        left = max(0.0, self._start + seconds - time.monotonic())
        return await asyncio.wait_for(asyncio.wrap_future(self._future), left)
