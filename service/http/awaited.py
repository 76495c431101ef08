"""Work that is dropped when the client that awaits it hangs up."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import TypeVar

from fastapi import Request
from starlette.concurrency import run_in_threadpool

LOOK_SECONDS = 1.0
Made = TypeVar("Made")


async def while_awaited(request: Request, make: Callable[[Callable[[], bool]], Made]) -> Made:
    """Run ``make(gone)`` in a thread and return its result; ``gone()`` says whether the client has hung up."""
    gone = threading.Event()
    making = asyncio.ensure_future(run_in_threadpool(make, gone.is_set))
    while not making.done():
        await asyncio.wait([making], timeout=LOOK_SECONDS)
        if not making.done() and await request.is_disconnected():
            gone.set()
    return making.result()
