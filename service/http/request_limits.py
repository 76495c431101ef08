"""Middleware that checks host, origin and size of every request, adds security headers and sends bodies in chunks.

All middleware of the service is plain ASGI: middleware that returns a whole response would buffer the event streams.
"""

from __future__ import annotations

import re
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from wingfit.service.auth.authentication import API
from wingfit.service.http.problems import ProblemError, response

UPLOAD_PATHS = frozenset({"/v1/datasets", "/v1/imports", "/v1/imports/table", "/v1/imports/description"})
UPLOAD_LIMIT = 64 * 2**20
# Boundaries and headers of the multipart form around the file.
FORM_OVERHEAD = 64 * 2**10
BODY_LIMIT = 2**20
DRIVE_PATH, RESULTS, RESULTS_LIMIT = "/v1/drive/", "/results", 8 * 2**20  # of many simulations
FILM_FILE = re.compile(r"/v1/films/[^/]+/files/[^/]+")  # streamed to the disk
CHUNK = 256 * 2**10
# Load balancers and Kubernetes probe these by IP address; they return nothing that was uploaded or computed.
PROBES = frozenset({"/v1/health", "/v1/ready", "/v1/metrics"})
CHANGING = frozenset({"POST", "PUT", "PATCH", "DELETE"})

SECURITY_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
        "object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
}
RAW_HEADERS = [(name.lower().encode(), value.encode()) for name, value in SECURITY_HEADERS.items()]


class RequestLimits:
    """Middleware that refuses requests by host, origin or size.

    ``allowed_hosts``: host names of this server; ``film_mib``: most MiB of a file of a film.
    """

    def __init__(self, app: ASGIApp, allowed_hosts: tuple[str, ...], film_mib: int) -> None:
        self.app, self.allowed_hosts, self._film_limit = app, frozenset(allowed_hosts), film_mib * 2**20

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Check one request, and pass it on or refuse it."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        refusal = self._refusal(scope)
        if refusal:
            await response(refusal)(scope, receive, _response_sender(send))
            return
        # HEAD is answered as GET without its body; an event stream would never end.
        headers_only = scope["method"] == "HEAD" and not scope["path"].endswith("/events")
        if headers_only:
            scope = {**scope, "method": "GET"}
        await self.app(scope, _limited(receive, self._limit(scope)), _response_sender(send, headers_only=headers_only))

    def _refusal(self, scope: Scope) -> ProblemError | None:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        is_probe = scope["path"] in PROBES and scope["method"] in ("GET", "HEAD")
        if _host_name(host) not in self.allowed_hosts and not is_probe:
            return ProblemError(
                400,
                "host",
                f"this server does not answer for the host name {host[:200]!r}; use localhost, or add the host to "
                "WINGFIT_ALLOWED_HOSTS",
            )
        if _is_foreign(headers, host):
            if scope["method"] in CHANGING:
                return ProblemError(403, "origin", "a page of another origin may not change anything on this server")
            if scope["path"].startswith(API):
                return ProblemError(
                    403, "origin", f"a page of another site may not read or link to {API}; open the page of this server"
                )
        length = headers.get("content-length", "0")
        if length.isdecimal() and int(length) > self._limit(scope):
            return _too_large(self._limit(scope))
        return None

    def _limit(self, scope: Scope) -> int:
        path = scope["path"]
        if scope["method"] == "PUT" and FILM_FILE.fullmatch(path):
            return self._film_limit
        if path.startswith(DRIVE_PATH) and path.endswith(RESULTS):
            return RESULTS_LIMIT
        return UPLOAD_LIMIT + FORM_OVERHEAD if path in UPLOAD_PATHS else BODY_LIMIT


def _host_name(host: str) -> str:
    try:
        return (urlsplit(f"//{host}").hostname or "").lower()
    except ValueError:
        return ""


def _is_foreign(headers: Headers, host: str) -> bool:
    origin = headers.get("origin")
    if origin is None:
        return headers.get("sec-fetch-site", "none") not in ("none", "same-origin")
    try:
        return not _host_name(host) or urlsplit(origin).netloc.lower() != host.lower()
    except ValueError:
        return True


def _too_large(limit: int) -> ProblemError:
    return ProblemError(413, "too-large", f"the request body is larger than {limit / 2**20:.0f} MiB; send less")


def _limited(receive: Receive, limit: int) -> Receive:
    """Wrap ``receive`` to count the body's bytes (a chunked body has no Content-Length); a 413 above ``limit``."""
    received = 0

    async def counted() -> Message:
        nonlocal received
        message = await receive()
        if message["type"] == "http.request":
            received += len(message.get("body", b""))
            if received > limit:
                raise HTTPException(413, _too_large(limit).detail)
        return message

    return counted


def _response_sender(send: Send, *, headers_only: bool = False) -> Send:
    """Wrap ``send`` to add the security headers, and to send a large body in chunks (``headers_only``: no body).

    Each chunk waits until the client has received the one before. A body sent whole would wait in memory while its
    request counts as answered, so that the limits on concurrent requests would not limit the bodies in memory.
    """

    async def sender(message: Message) -> None:
        if message["type"] == "http.response.start":
            given = list(message["headers"])
            names = {name for name, _ in given}
            message["headers"] = given + [header for header in RAW_HEADERS if header[0] not in names]
        body = b"" if headers_only else message.get("body", b"")
        if message["type"] != "http.response.body" or len(body) <= CHUNK:
            await send({**message, "body": body} if headers_only and "body" in message else message)
            return
        view = memoryview(body)
        for start in range(0, len(body), CHUNK):
            more = start + CHUNK < len(body) or message.get("more_body", False)
            await send({"type": message["type"], "body": view[start : start + CHUNK], "more_body": more})

    return sender
