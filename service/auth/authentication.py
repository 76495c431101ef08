"""Asks for an API key before anything of the API is answered.

Plain ASGI like :mod:`wingfit.service.http.request_limits`. Who calls is kept for the length of the request
(:data:`wingfit.service.auth.access.CALLER`).
"""

from __future__ import annotations

from http.cookies import CookieError, SimpleCookie

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from wingfit.service.auth.access import CALLER_OF, Caller, KeyRing, calling
from wingfit.service.auth.access import Scope as KeyScope
from wingfit.service.http.problems import ProblemError, response

COOKIE = "wingfit_key"
API = "/v1/"
ADMINISTRATION = ("/v1/keys", "/v1/backup")
OPEN = frozenset({"/v1/health", "/v1/ready", "/v1/session"})  # says little, and lets a browser in
READING = frozenset({"GET", "HEAD", "OPTIONS"})


class Gate:
    """Refuses calls of the API without a good key for them; the page itself holds no data and is open."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one connection."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        caller = _caller(Headers(scope=scope), scope["app"].state.service.keys)
        scope[CALLER_OF] = caller
        refusal = _refusal(scope, caller)
        if refusal:
            challenge = {"WWW-Authenticate": "Bearer"} if refusal.status == 401 else {}
            await response(refusal, challenge)(scope, receive, send)
            return
        with calling(caller):
            await self.app(scope, receive, send)


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
    path, needed = scope["path"], needed_for(scope["method"], scope["path"])
    if not path.startswith(API) or path in OPEN:
        return None
    if caller is None:
        return ProblemError(
            401,
            "key",
            "this server asks for an API key, and none came, or one that is not good; send 'Authorization: Bearer KEY' "
            "or set WINGFIT_API_KEY. Whoever runs the server makes one: wingfit keys create NAME",
        )
    if not caller.may(needed):
        good = ", ".join(sorted(caller.scopes))
        return ProblemError(403, "scope", f"key {caller.key} is good for {good}, not {needed}; use another key")
    return None


def needed_for(method: str, path: str) -> KeyScope:
    """What a key must be good for."""
    if any(path == root or path.startswith(f"{root}/") for root in ADMINISTRATION):
        return "admin"
    return "read" if method in READING else "write"
