"""Requires an API key for every path below ``/v1/``, and sets :data:`wingfit.service.auth.access.CALLER`."""

from __future__ import annotations

from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from wingfit.service.auth.access import CALLER, CALLER_IN_SCOPE, Caller, KeyRing
from wingfit.service.auth.access import Scope as KeyScope
from wingfit.service.http.problems import ProblemError, response

COOKIE = "wingfit_key"
API = "/v1/"
ADMINISTRATION = ("/v1/keys", "/v1/backup")
# Open without a key: liveness, readiness, and the login of the web page.
OPEN = frozenset({"/v1/health", "/v1/ready", "/v1/session"})
READING = frozenset({"GET", "HEAD", "OPTIONS"})


class Authentication:
    """Middleware that refuses API calls without a valid key of the required scope; the web page requires no key."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Check one request, and pass it on with its caller set, or refuse it."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        caller = _caller(Headers(scope=scope), scope["app"].state.service.keys)
        scope[CALLER_IN_SCOPE] = caller
        refusal = _refusal(scope, caller)
        if refusal:
            challenge = {"WWW-Authenticate": "Bearer"} if refusal.status == 401 else {}
            await response(refusal, challenge)(scope, receive, send)
            return
        token = CALLER.set(caller)
        try:
            await self.app(scope, receive, send)
        finally:
            CALLER.reset(token)


def _caller(headers: Headers, keys: KeyRing) -> Caller | None:
    kind, _, secret = headers.get("authorization", "").partition(" ")
    if kind.lower() == "bearer":
        return keys.caller(secret.strip())
    try:
        cookie = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:
        return None
    return keys.caller(cookie.value) if cookie else None


def _refusal(scope: Scope, caller: Caller | None) -> ProblemError | None:
    path, needed = scope["path"], needed_scope(scope["method"], scope["path"])
    if not path.startswith(API) or path in OPEN:
        return None
    if caller is None:
        return ProblemError(
            401,
            "key",
            "this server requires an API key, and the request has no key or an invalid one; send 'Authorization: "
            "Bearer KEY' or set WINGFIT_API_KEY. The operator of the server makes keys with: wingfit keys create NAME",
        )
    if not caller.may(needed):
        scopes = ", ".join(sorted(caller.scopes))
        return ProblemError(
            403, "scope", f"key {caller.key} has the scope {scopes}; this call needs {needed}; use another key"
        )
    return None


def needed_scope(method: str, path: str) -> KeyScope:
    """Return the scope (read, write or admin) that a key must have for a request with this method and path."""
    if any(path == root or path.startswith(f"{root}/") for root in ADMINISTRATION):
        return "admin"
    return "read" if method in READING else "write"
