"""Routes that list, create and revoke API keys, and that store a key in a browser's cookie."""

from __future__ import annotations

from fastapi import APIRouter, Request
from starlette.responses import JSONResponse, Response

from wingfit.client.key_answers import Key, Keys, NewKey, Session
from wingfit.service.answers import answer
from wingfit.service.auth import keys
from wingfit.service.auth.access import CALLER, CALLER_IN_SCOPE, Caller
from wingfit.service.auth.authentication import COOKIE
from wingfit.service.auth.key_schemas import KeyIn, SessionIn
from wingfit.service.container import Service, ServiceDep
from wingfit.service.http import responses as http
from wingfit.service.http.problems import ProblemError

router = APIRouter(prefix="/v1", tags=["keys"])
COOKIE_SECONDS = 30 * 86400


@router.get("/keys", responses=http.errors(), summary="List keys")
def list_keys(service: ServiceDep) -> Keys:
    """List all keys, newest first, without their secrets."""
    with service.database.read() as session:
        return {"items": [answer(Key, row) for row in keys.every(session)]}


@router.post("/keys", status_code=201, responses=http.errors(), summary="Make a key")
def make(service: ServiceDep, body: KeyIn) -> NewKey:
    """Create a key. Only this answer contains its secret."""
    with service.database.write() as session:
        row, secret = keys.make(session, body.name, body.owner or body.name, body.scopes)
    service.load_keys()
    return answer(NewKey, row, secret=secret)


@router.delete("/keys/{key_id}", responses=http.errors(404, 409), summary="Revoke a key")
def revoke(service: ServiceDep, key_id: str) -> Key:
    """Revoke a key at once; datasets and jobs that were made with it stay."""
    with service.database.write() as session:
        row = keys.revoke(session, key_id)
    service.load_keys()
    return answer(Key, row)


@router.get("/session", responses=http.errors(), summary="Who is calling")
def session(service: ServiceDep) -> Session:
    """Return whether keys are required, and the id, owner and scopes of the key of this request."""
    return _session(service, CALLER.get())


@router.post("/session", response_model=Session, responses=http.errors(401), summary="Let a browser in")
def begin(service: ServiceDep, request: Request, body: SessionIn) -> Response:
    """Store a valid key in a cookie that scripts cannot read and other sites cannot send."""
    caller = service.keys.caller(body.key)
    if caller is None:
        raise ProblemError(401, "key", "this is not a key of this server, or one that was revoked")
    request.scope[CALLER_IN_SCOPE] = caller
    response = JSONResponse(_session(service, caller))
    secure = request.url.scheme == "https"
    response.set_cookie(COOKIE, body.key, COOKIE_SECONDS, httponly=True, samesite="strict", secure=secure)
    return response


@router.delete("/session", status_code=204, responses=http.errors(), summary="Forget the key of a browser")
def end() -> Response:
    """Delete the cookie with the key; the key stays valid."""
    response = Response(status_code=204)
    response.delete_cookie(COOKIE)
    return response


def _session(service: Service, caller: Caller | None) -> Session:
    key, owner, scopes = (caller.key, caller.owner, sorted(caller.scopes)) if caller else (None, None, [])
    return {"keys_required": service.settings.keys, "key_id": key, "owner": owner, "scopes": scopes}
