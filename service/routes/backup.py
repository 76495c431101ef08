"""A copy of everything, while the service works."""

from __future__ import annotations

from collections.abc import Iterator
from typing import BinaryIO

from fastapi import APIRouter
from starlette.responses import StreamingResponse

from service import http, store
from service.backup import BackupError, snapshot
from service.problems import ProblemError
from service.state import ServiceDep

router = APIRouter(prefix="/v1/backup", tags=["service"])
MEDIA_TYPE = "application/vnd.sqlite3"
PIECE = 2**20


@router.get(
    "",
    response_class=StreamingResponse,
    responses={
        200: {"content": {MEDIA_TYPE: {"schema": {"type": "string", "format": "binary"}}}},
        **http.errors(507),
    },
    summary="Fetch a backup",
)
def backup(service: ServiceDep) -> StreamingResponse:
    """Return a checked copy of the database as it is now: datasets, runs, diagnoses and keys."""
    try:
        path = snapshot(service.settings.data)
    except BackupError as error:
        raise ProblemError(507, "no-backup", str(error)) from None
    opened = path.open("rb")
    size = path.stat().st_size
    path.unlink()  # the open file lasts as long as the answer, however that ends
    name = f"wingfit-{store.now()[:19].replace(':', '')}Z.sqlite3"
    headers = {"Content-Length": str(size), **http.attachment(name)}
    return StreamingResponse(_pieces(opened), media_type=MEDIA_TYPE, headers=headers)


def _pieces(opened: BinaryIO) -> Iterator[bytes]:
    with opened:
        while piece := opened.read(PIECE):
            yield piece
