"""API keys, and the session of a browser that has one."""

from __future__ import annotations

from fastapi import APIRouter, Request
from starlette.responses import JSONResponse, Response

from wingfit.service.auth import keys
from wingfit.service.auth.access import CALLER, CALLER_IN_SCOPE
from wingfit.service.auth.authentication import COOKIE
from wingfit.service.auth.key_schemas import KeyIn, KeyOut, KeysOut, NewKeyOut, SessionIn, SessionOut
from wingfit.service.container import ServiceDep
from wingfit.service.http import responses as http
from wingfit.service.http.problems import ProblemError

router = APIRouter(prefix="/v1", tags=["keys"])
COOKIE_SECONDS = 30 * 86400


@router.get("/keys", responses=http.errors(), summary="List keys")
def list_keys(service: ServiceDep) -> KeysOut:
    """List all keys, newest first, without their secrets."""
    with service.database.read() as session:
        return KeysOut(items=[KeyOut.of(row) for row in keys.every(session)])


@router.post("/keys", status_code=201, responses=http.errors(), summary="Make a key")
def make(service: ServiceDep, body: KeyIn) -> NewKeyOut:
    """Make a key. Its secret is in the answer, and nowhere else."""
    with service.database.write() as session:
        row, secret = keys.make(session, body.name, body.owner or body.name, body.scopes)
    service.load_keys()
    return NewKeyOut(**KeyOut.of(row).model_dump(), secret=secret)


@router.delete("/keys/{key_id}", responses=http.errors(404, 409), summary="Revoke a key")
def revoke(service: ServiceDep, key_id: str) -> KeyOut:
    """Make a key good for nothing, at once; what was made with it stays."""
    with service.database.write() as session:
        row = keys.revoke(session, key_id)
    service.load_keys()
    return KeyOut.of(row)


@router.get("/session", responses=http.errors(), summary="Who is calling")
def session(service: ServiceDep) -> SessionOut:
    """Say whether keys are asked for, and whose key came."""
    return SessionOut.of(CALLER.get(), required=service.settings.keys)


@router.post("/session", response_model=SessionOut, responses=http.errors(401), summary="Let a browser in")
def begin(service: ServiceDep, request: Request, body: SessionIn) -> Response:
    """Keep a key in a cookie that no script can read and no other site can send."""
    caller = service.keys.caller(body.key)
    if caller is None:
        raise ProblemError(401, "key", "this is not a key of this server, or one that was revoked")
    request.scope[CALLER_IN_SCOPE] = caller
    answer = JSONResponse(SessionOut.of(caller, required=service.settings.keys).model_dump())
    secure = request.url.scheme == "https"
    answer.set_cookie(COOKIE, body.key, COOKIE_SECONDS, httponly=True, samesite="strict", secure=secure)
    return answer


@router.delete("/session", status_code=204, responses=http.errors(), summary="Forget the key of a browser")
def end() -> Response:
    """Forget the cookie; the key stays good."""
    answer = Response(status_code=204)
    answer.delete_cookie(COOKIE)
    return answer
