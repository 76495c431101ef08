"""Runs the service: opens the port and the data folder, or reports why that is impossible, then starts uvicorn."""

from __future__ import annotations

import errno
import gc
import logging
import signal
import socket
import sys
from collections.abc import Iterator
from dataclasses import replace
from types import FrameType
from typing import Unpack

import uvicorn
from fastapi import FastAPI

from wingfit.service.app import create_app
from wingfit.service.auth import keys
from wingfit.service.container import Parts
from wingfit.service.http.header_limits import Protocol
from wingfit.service.operations import shutdown
from wingfit.service.operations.metrics_and_log import set_up_log
from wingfit.service.operations.shutdown import Deadline, StopLimits, Watchdog
from wingfit.service.settings import Settings, SettingsError, is_loopback
from wingfit.service.storage.database import Database, DataFolderError

LOG = logging.getLogger("wingfit")
# Time slice of a Python thread. A database read releases the interpreter at every row, so with the default of 5 ms a
# page of several rows would wait for computing threads most of the time.
SWITCH_SECONDS = 0.0005
PORT_TAKEN = (errno.EADDRINUSE, errno.EACCES)


class ServeError(RuntimeError):
    """Raised when the service cannot start; the message says why, and what to do."""


class _Server(uvicorn.Server):
    """uvicorn's server, which a signal stops in bounded time.

    It ends open event streams itself, because uvicorn would wait for them.
    """

    def __init__(self, config: uvicorn.Config, app: FastAPI, limits: StopLimits) -> None:
        super().__init__(config)
        self._app = app
        self._deadline = Deadline(lambda: _unfinished(app), limits.give_up)
        self._watchdog = Watchdog(limits.kill)

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start the server; from now on a signal stops it, even if the start hangs."""
        self._watchdog.listen()
        await super().startup(sockets)

    async def on_tick(self, counter: int) -> bool:
        """Install the signal handlers again at every tick of uvicorn (0.1 s), because Ray replaces them."""
        for number in shutdown.SIGNALS:
            signal.signal(number, self.handle_exit)
        self._watchdog.listen()
        return await super().on_tick(counter)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:  # noqa: ARG002  uvicorn's signature
        self._deadline.begin()
        # Without uvicorn's handler, which raises the signal again: the exit status of a clean stop is 0.
        first, self.should_exit = not self.should_exit, True
        self.force_exit |= not first and sig == signal.SIGINT
        service = getattr(self._app.state, "service", None)
        if service is not None and first:  # a second signal may interrupt this handler
            service.begin_stop()


def _unfinished(app: FastAPI) -> Iterator[str]:
    service = getattr(app.state, "service", None)
    return service.unfinished() if service is not None else iter(())


def serve(settings: Settings, *, limits: StopLimits | None = None, **parts: Unpack[Parts]) -> None:
    """Serve until SIGTERM or Ctrl-C; ServeError if the data folder or the port is not available.

    ``limits``: on the time to stop; ``parts`` replace parts of the service, for tests.
    """
    limits = limits or StopLimits()
    set_up_log(settings.log)
    sys.setswitchinterval(SWITCH_SECONDS)
    listening = _listen(settings)
    try:
        database = Database(settings.data)
    except DataFolderError as error:
        listening.close()
        raise ServeError(str(error)) from None
    settings = replace(settings, port=listening.getsockname()[1])
    if settings.keys:
        _require_admin_key(settings, database, listening)
    elif not is_loopback(settings.host):
        LOG.warning("listening on %s without keys: anyone who can connect can read and delete all data", settings.host)
    app = create_app(settings, database=database, limits=limits, **parts)
    config = uvicorn.Config(
        app,
        loop="uvloop",
        http=Protocol,
        access_log=False,
        log_level="warning",
        timeout_graceful_shutdown=limits.requests,
        server_header=False,
    )
    # Exclude what is loaded by now from garbage collection, which would delay every answer by a tenth of a second.
    gc.freeze()
    LOG.info("wingfit is at %s (data in %s)", settings.url, settings.data.resolve())
    try:
        _Server(config, app, limits).run(sockets=[listening])
    finally:
        stopped = getattr(app.state, "stopped", True) and database.close(limits.database)
    if not stopped or shutdown.held_up():
        # A thread still runs. Do not wait for it: the next start repeats its computation.
        shutdown.log_threads()
        shutdown.leave()


def _require_admin_key(settings: Settings, database: Database, listening: socket.socket) -> None:
    """Raise ServeError if no valid API key can manage keys, because nobody could then create any key."""
    with database.read() as session:
        known = any(row.revoked_at is None and "admin" in row.scopes for row in keys.every(session))
    if not known:
        database.close()
        listening.close()
        raise ServeError(
            f"a server on {settings.host} requires API keys, and there is no key with the scope admin; make one: "
            f"wingfit keys create NAME --scope admin --data {settings.data}"
        )


def main() -> None:
    """Serve with the settings in the environment."""
    try:
        serve(Settings.from_env())
    except (ServeError, SettingsError) as error:
        sys.exit(f"wingfit: {error}")


def _listen(settings: Settings) -> socket.socket:
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    try:
        # With the protocol given, asyncio disables Nagle's algorithm, which would delay every answer by 40 ms.
        listening = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    except OSError as error:  # a system without IPv6
        raise _cannot_listen(settings, error) from None
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((settings.host, settings.port))
        listening.listen(128)
    except (OSError, TypeError, UnicodeError) as error:  # TypeError, UnicodeError: an invalid host name
        listening.close()
        raise _cannot_listen(settings, error) from None
    return listening


def _cannot_listen(settings: Settings, error: Exception) -> ServeError:
    taken = isinstance(error, OSError) and error.errno in PORT_TAKEN
    remedy = "WINGFIT_PORT to a free port" if taken else "WINGFIT_HOST to an address of this machine"
    reason = getattr(error, "strerror", None) or error
    return ServeError(f"cannot listen on {settings.host}, port {settings.port}: {reason}; set {remedy}")


if __name__ == "__main__":
    main()
