"""What stands before every request: who may ask, how much may be sent, which headers go out.

Plain ASGI, because wrapping a stream in a request-response middleware would buffer the event stream.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from wingfit.service.auth.authentication import API
from wingfit.service.http.problems import ProblemError, response

UPLOAD_PATH = "/v1/datasets"
UPLOAD_LIMIT = 64 * 2**20
# Boundaries and headers of the multipart form around a file of the largest size.
FORM_SLACK = 64 * 2**10
BODY_LIMIT = 2**20
# Load balancers and Kubernetes probe by address; no answer has anything that was uploaded or computed.
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


class Guard:
    """Checks host, origin and size, and adds the security headers."""

    def __init__(self, app: ASGIApp, allowed_hosts: tuple[str, ...]) -> None:
        self.app, self.allowed_hosts = app, frozenset(allowed_hosts)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one connection."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        guarded = _with_headers(send)
        refusal = self._refusal(scope)
        if refusal:
            await response(refusal)(scope, receive, guarded)
            return
        if scope["method"] == "HEAD" and not scope["path"].endswith("/events"):  # which would never end
            scope, guarded = {**scope, "method": "GET"}, _without_body(guarded)
        await self.app(scope, _limited(receive, _limit(scope)), guarded)

    def _refusal(self, scope: Scope) -> ProblemError | None:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if _name(host) not in self.allowed_hosts and not _is_probe(scope):
            return ProblemError(
                400,
                "host",
                f"this server does not answer for the host name {host[:200]!r}; use localhost, or name the "
                "host in WINGFIT_ALLOWED_HOSTS",
            )
        if _is_foreign(headers, host):
            if scope["method"] in CHANGING:
                return ProblemError(403, "origin", "a page of another origin may not change anything here")
            if scope["path"].startswith(API):
                return ProblemError(
                    403, "origin", f"a page of another site may not read or link to {API}; open the page of this server"
                )
        length = headers.get("content-length", "0")
        if length.isdecimal() and int(length) > _limit(scope):
            return _too_large(_limit(scope))
        return None


def _is_probe(scope: Scope) -> bool:
    return scope["path"] in PROBES and scope["method"] in ("GET", "HEAD")


def _name(host: str) -> str:
    try:
        return (urlsplit(f"//{host}").hostname or "").lower()
    except ValueError:
        return ""


def _place(origin: str) -> str | None:
    try:
        return urlsplit(origin).netloc.lower()
    except ValueError:
        return None


def _is_foreign(headers: Headers, host: str) -> bool:
    origin = headers.get("origin")
    if origin is not None:
        return not _name(host) or _place(origin) != host.lower()
    return headers.get("sec-fetch-site", "none") not in ("none", "same-origin")


def _limit(scope: Scope) -> int:
    return UPLOAD_LIMIT + FORM_SLACK if scope["path"] == UPLOAD_PATH else BODY_LIMIT


def _too_large(limit: int) -> ProblemError:
    return ProblemError(413, "too-large", f"the request body is larger than {limit / 2**20:.0f} MiB")


def _limited(receive: Receive, limit: int) -> Receive:
    taken = 0

    async def counted() -> Message:
        nonlocal taken
        message = await receive()
        if message["type"] == "http.request":
            taken += len(message.get("body", b""))
            if taken > limit:
                raise HTTPException(413, _too_large(limit).detail)
        return message

    return counted


def _without_body(send: Callable[[Message], Awaitable[None]]) -> Callable[[Message], Awaitable[None]]:
    """Answer a HEAD as a GET is answered, headers and all, without what they describe."""

    async def headed(message: Message) -> None:
        if message["type"] == "http.response.body":
            message = {**message, "body": b""}
        await send(message)

    return headed


def _with_headers(send: Send) -> Callable[[Message], Awaitable[None]]:
    async def headed(message: Message) -> None:
        if message["type"] == "http.response.start":
            given = list(message["headers"])
            names = {name for name, _ in given}
            message["headers"] = given + [header for header in RAW_HEADERS if header[0] not in names]
        await send(message)

    return headed
