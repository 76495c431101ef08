"""A log line for every attempt to change something: who, what, and with which result.

The lines go to the logger ``wingfit.audit``. Whatever a caller can choose (path, name of an owner) is written with its
control characters escaped, so that no request can forge a line.
"""

from __future__ import annotations

import logging

from starlette.types import Scope

from wingfit.service.auth.access import CALLER_OF, Caller
from wingfit.service.auth.authentication import API
from wingfit.service.http.request_limits import CHANGING

LOG = logging.getLogger("wingfit.audit")
LONGEST = 1000  # characters of a path
NOBODY = "-"


def record(scope: Scope, status: int, request: str) -> None:
    """Log an answered ``request`` (its id) if its method can change something, also one that was refused.

    Key and owner are ``-`` where no key is asked for, and where none that is good came.
    """
    if scope["method"] not in CHANGING or not scope["path"].startswith(API):
        return
    caller: Caller | None = scope.get(CALLER_OF)
    fields = {
        "method": scope["method"],
        "template": getattr(scope.get("route"), "path", "") or NOBODY,
        "status": status,
        "key": caller.key if caller else NOBODY,
        "owner": caller.owner if caller else NOBODY,
        "path": scope["path"][:LONGEST],
        "request": request,
    }
    line = "%(method)s %(template)s %(status)d key=%(key)s owner=%(owner)a path=%(path)a request=%(request)s"
    LOG.info(line, fields, extra=fields)
