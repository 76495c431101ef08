"""Route that returns a backup (a copy of the database) while the service runs."""

from __future__ import annotations

import os
from collections.abc import AsyncIterator
from typing import Annotated, BinaryIO

from fastapi import APIRouter, Depends, Request
from starlette.concurrency import run_in_threadpool
from starlette.responses import StreamingResponse

from wingfit.service.container import Service, ServiceDep
from wingfit.service.http import responses as http
from wingfit.service.http.problems import ProblemError
from wingfit.service.storage import store
from wingfit.service.storage.backup import BackupError, snapshot

router = APIRouter(prefix="/v1/backup", tags=["service"])
MEDIA_TYPE = "application/vnd.sqlite3"
PIECE = 2**20


async def _copy(request: Request, service: ServiceDep) -> AsyncIterator[BinaryIO]:
    """Yield a copy of the database, opened for reading; one at a time, and removed when the request ends."""
    async with service.backups.slot():
        if await request.is_disconnected():
            raise ProblemError(503, "busy", "the client of this backup is gone")
        opened = await run_in_threadpool(_opened, service)
        try:
            yield opened
        finally:
            opened.close()


@router.get(
    "",
    response_class=StreamingResponse,
    responses={
        200: {"content": {MEDIA_TYPE: {"schema": {"type": "string", "format": "binary"}}}},
        **http.errors(503, 507),
    },
    summary="Fetch a backup",
)
async def backup(copy: Annotated[BinaryIO, Depends(_copy)]) -> StreamingResponse:
    """Return a checked copy of the database as it is now: datasets, jobs, keys, and films without their files."""
    name = f"wingfit-{store.now()[:19].replace(':', '')}Z.sqlite3"
    headers = {"Content-Length": str(os.fstat(copy.fileno()).st_size), **http.attachment(name)}
    return StreamingResponse(_pieces(copy), media_type=MEDIA_TYPE, headers=headers)


def _opened(service: Service) -> BinaryIO:
    try:
        path = snapshot(service.settings.data)
    except BackupError as error:
        raise ProblemError(507, "no-backup", str(error)) from None
    try:
        return path.open("rb")
    finally:
        path.unlink()  # the open file stays readable until it is closed


async def _pieces(opened: BinaryIO) -> AsyncIterator[bytes]:
    while piece := await run_in_threadpool(opened.read, PIECE):
        yield piece
