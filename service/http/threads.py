"""Daemon threads for one call each: unlike those of a pool they are never used up, and no exit waits for them."""

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
    """Call ``function`` in a thread of its own called ``name``; the result, when there is one."""
    future: Future[Result] = Future()
    future.set_running_or_notify_cancel()  # who no longer waits does not stop it

    def run() -> None:
        try:
            result = function()
        except BaseException as error:
            future.set_exception(error)
        else:
            future.set_result(result)

    threading.Thread(target=run, name=name, daemon=True).start()
    return future


def done_within(seconds: float, name: str, function: Callable[[], bool]) -> bool:
    """Whether ``function`` returns True within ``seconds``; it goes on in its thread if it takes longer."""
    try:
        return call(name, function).result(seconds)
    except TimeoutError:
        return False
    except Exception:
        LOG.exception("%s failed", name)
        return False


class Shared(Generic[Result]):
    """A function in a thread of its own, called once for all who wait for it at a time; never twice at a time."""

    def __init__(self, name: str, function: Callable[[], Result]) -> None:
        self._name, self._function = name, function
        self._under_way: Future[Result] | None = None
        self._began = 0.0

    async def result(self, seconds: float) -> Result:
        """What the function returns; TimeoutError once the call under way lasts longer than ``seconds``.

        To be awaited in one event loop.
        """
        if self._under_way is None or self._under_way.done():
            self._began, self._under_way = time.monotonic(), call(self._name, self._function)
        left = max(0.0, self._began + seconds - time.monotonic())
        return await asyncio.wait_for(asyncio.wrap_future(self._under_way), left)
