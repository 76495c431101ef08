"""The audit log: one line for every request that can change something, with caller and status.

The lines go to the logger ``wingfit.audit``. Control characters in what a caller can choose (path, name of an owner)
are escaped, so that no request can forge a line.
"""

from __future__ import annotations

import logging

from starlette.types import Scope

from wingfit.service.auth.access import CALLER_IN_SCOPE, Caller
from wingfit.service.auth.authentication import API
from wingfit.service.http.request_limits import CHANGING, DRIVE_PATH

LOG = logging.getLogger("wingfit.audit")
LONGEST_PATH = 1000  # characters
UNKNOWN = "-"


def record(scope: Scope, status: int, request_id: str) -> None:
    """Log a request to the API if its method can change something; ``status``: HTTP status of the answer.

    Of drivers, which send several a second, only refused requests are logged.

    ``scope``: ASGI scope of the request. Key and owner are logged as ``-`` if the request had no valid key.
    """
    path = scope["path"]
    if scope["method"] not in CHANGING or not path.startswith(API) or (path.startswith(DRIVE_PATH) and status < 400):
        return
    caller: Caller | None = scope.get(CALLER_IN_SCOPE)
    fields = {
        "method": scope["method"],
        "template": getattr(scope.get("route"), "path", "") or UNKNOWN,
        "status": status,
        "key": caller.key if caller else UNKNOWN,
        "owner": caller.owner if caller else UNKNOWN,
        "path": path[:LONGEST_PATH],
        "request": request_id,
    }
    line = "%(method)s %(template)s %(status)d key=%(key)s owner=%(owner)a path=%(path)a request=%(request)s"
    LOG.info(line, fields, extra=fields)
