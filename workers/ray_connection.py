"""Connects this process to Ray: joins a cluster, or starts a local Ray.

Facts about Ray 2.60 behind this module:
- A local Ray ends with the *thread* that started it, and Ray kills a process whose Ray ended a minute ago. So a thread
  is made that connects and lives until the evaluator is closed. Outside the main thread, Ray also leaves the signal
  handlers of the process unchanged.
- Ray listens on all network interfaces. So a local Ray must require a token. It does so by default, but would write the
  token into a file that others can read; so the token is given in the environment.
- Ray's default folder stores cluster addresses that misdirect the next start. So the local Ray has its own folder.
"""

from __future__ import annotations

import atexit
import logging
import os
import secrets
import shutil
import sys
import tempfile
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from wingfit.workers.share import child_environment

# Ray reads these at import.
os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
os.environ.setdefault("RAY_IGNORE_UNHANDLED_ERRORS", "1")

import ray
from ray import exceptions as ray_errors

__all__ = ["Connection", "ray", "ray_errors"]

STOP_SECONDS = 30.0
OBJECT_STORE_BYTES = 256 * 2**20
# Ray creates sockets in its folder, and the path of a socket is limited to 107 bytes.
LONGEST_TEMP_PATH = 24
FOLDER = "wingfit-ray-"
QUIET: dict[str, Any] = {"log_to_driver": False, "logging_level": logging.ERROR}


class Connection:
    """A connection to the Ray cluster at ``address`` or, if that is None, to a local Ray with ``workers`` processors.

    The connection is made by a thread that lives until :meth:`close`.
    """

    def __init__(self, workers: int | None, address: str | None) -> None:
        if ray.is_initialized():
            raise RuntimeError("this process already has a connection to Ray; close its other Ray evaluator")
        connect = (lambda: _join(address)) if address else (lambda: _start(workers or os.cpu_count() or 1))
        self._failure: BaseException | None = None
        self._connected, self._leave = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._live, args=(connect,), name="ray", daemon=True)
        self._thread.start()
        self._connected.wait()
        if self._failure:
            raise self._failure
        atexit.register(self.close)

    def close(self) -> None:
        """Disconnect from Ray, and stop it if it was started here."""
        atexit.unregister(self.close)
        self._leave.set()
        self._thread.join(STOP_SECONDS)

    def _live(self, connect: Callable[[], Callable[[], None]]) -> None:
        try:
            leave = connect()
        except BaseException as failure:
            self._failure = failure
            return
        finally:
            self._connected.set()
        self._leave.wait()
        leave()


def _join(address: str) -> Callable[[], None]:
    try:
        ray.init(address=address, **QUIET)
    except (ConnectionError, RuntimeError, ValueError, ray_errors.RayError) as error:
        _stop()
        raise ConnectionError(
            f"cannot join the Ray cluster at {address!r}: {error}. This machine must run a node of it "
            "(ray start --address=...), and RAY_AUTH_MODE and RAY_AUTH_TOKEN_PATH must be the same everywhere"
        ) from error
    return _stop


def _start(workers: int) -> Callable[[], None]:
    if not {"RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH"} & set(os.environ):
        os.environ["RAY_AUTH_TOKEN"] = secrets.token_hex(32)
    folder = _own_folder()
    try:
        # Ray passes only the folder of the script to its workers, not the rest of the search path.
        with child_environment(PYTHONPATH=os.pathsep.join(filter(None, sys.path))):
            ray.init(
                address="local",
                num_cpus=workers,
                num_gpus=0,
                include_dashboard=False,
                object_store_memory=OBJECT_STORE_BYTES,
                _temp_dir=str(folder),
                **QUIET,
            )
    except BaseException:
        _stop(folder)
        raise
    return lambda: _stop(folder)


def _stop(folder: Path | None = None) -> None:
    with suppress(Exception):
        ray.shutdown()
    if folder:
        shutil.rmtree(folder, ignore_errors=True)


def _own_folder() -> Path:
    """Create a private folder for a local Ray; remove such folders of processes that have ended."""
    usual = Path(tempfile.gettempdir())
    base = usual if len(str(usual)) <= LONGEST_TEMP_PATH else Path("/tmp")  # noqa: S108  mkdtemp is private
    for old in base.glob(f"{FOLDER}*-*"):
        owner = old.name.removeprefix(FOLDER).split("-")[0]
        if owner.isdigit() and not Path("/proc", owner).exists():
            shutil.rmtree(old, ignore_errors=True)
    return Path(tempfile.mkdtemp(prefix=f"{FOLDER}{os.getpid()}-", dir=base))
