"""Settings of the service, read from environment variables that begin with ``WINGFIT_``."""

from __future__ import annotations

import ipaddress
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

EvaluatorKind = Literal["in_process", "processes", "ray"]
LOOPBACK_NAMES = ("localhost", "127.0.0.1", "::1")
MOST_WORKERS = 256  # each takes some hundred megabytes
YES = frozenset({"1", "true", "yes", "on"})


class SettingsError(ValueError):
    """A setting that the service cannot run with."""


@dataclass(frozen=True)
class Settings:
    """How the service runs.

    Attributes:
        data: folder of the database and its lock (``WINGFIT_DATA``).
        host: address to listen on (``WINGFIT_HOST``); one that is not loopback needs ``allow_remote``.
        port: TCP port (``WINGFIT_PORT``); 0 takes a free one.
        evaluator: what evaluates individuals (``WINGFIT_EVALUATOR``): in_process, processes or ray.
        workers: number of worker processes (``WINGFIT_WORKERS``); None lets the evaluator choose.
        ray_address: address of a standing Ray cluster (``WINGFIT_RAY_ADDRESS``); None starts one of our own.
        max_runs: runs computed at the same time (``WINGFIT_MAX_RUNS``).
        allow_remote: listen on other addresses than loopback, without keys (``WINGFIT_ALLOW_REMOTE=1``).
        allowed_hosts: host names that requests may carry (loopback names and ``WINGFIT_ALLOWED_HOSTS``).
    """

    data: Path
    host: str = "127.0.0.1"
    port: int = 8321
    evaluator: EvaluatorKind = "ray"
    workers: int | None = None
    ray_address: str | None = None
    max_runs: int = 2
    allow_remote: bool = False
    allowed_hosts: tuple[str, ...] = LOOPBACK_NAMES

    def __post_init__(self) -> None:
        _in_range("WINGFIT_PORT", self.port, 0, 65535)
        _in_range("WINGFIT_MAX_RUNS", self.max_runs, 1, 64)
        if self.workers is not None:
            _in_range("WINGFIT_WORKERS", self.workers, 1, MOST_WORKERS)
        if self.evaluator not in get_args(EvaluatorKind):
            raise SettingsError(
                f"WINGFIT_EVALUATOR is {self.evaluator!r}; it must be one of {', '.join(get_args(EvaluatorKind))}"
            )
        if not self.allow_remote and not is_loopback(self.host):
            raise SettingsError(
                f"WINGFIT_HOST is {self.host!r}, which other machines can reach, and there are no keys: "
                "whoever reaches it can read and delete everything. Use 127.0.0.1, or set "
                "WINGFIT_ALLOW_REMOTE=1 if a network of your own protects it"
            )

    @classmethod
    def from_env(cls, env: Mapping[str, str] | None = None) -> Settings:
        """Settings from ``env`` (default: the environment of the process)."""
        given = os.environ if env is None else env
        read = {key: value.strip() for key, value in given.items() if key.startswith("WINGFIT_") and value.strip()}
        extra = tuple(name.strip().lower() for name in read.get("WINGFIT_ALLOWED_HOSTS", "").split(",") if name.strip())
        return cls(
            data=Path(read.get("WINGFIT_DATA", "wingfit-data")).expanduser(),
            host=read.get("WINGFIT_HOST", cls.host),
            port=_integer(read, "WINGFIT_PORT", cls.port),
            evaluator=read.get("WINGFIT_EVALUATOR", cls.evaluator),  # type: ignore[arg-type]  # checked above
            workers=_integer(read, "WINGFIT_WORKERS", 0) if "WINGFIT_WORKERS" in read else None,
            ray_address=read.get("WINGFIT_RAY_ADDRESS"),
            max_runs=_integer(read, "WINGFIT_MAX_RUNS", cls.max_runs),
            allow_remote=read.get("WINGFIT_ALLOW_REMOTE", "").lower() in YES,
            allowed_hosts=LOOPBACK_NAMES + extra,
        )

    @property
    def url(self) -> str:
        """Where a browser on this machine finds the service."""
        host = self.host if is_loopback(self.host) else "localhost"
        return f"http://[{host}]:{self.port}/" if ":" in host else f"http://{host}:{self.port}/"


def is_loopback(host: str) -> bool:
    """Whether ``host`` names this machine only."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _integer(read: Mapping[str, str], name: str, default: int) -> int:
    text = read.get(name)
    if text is None:
        return default
    try:
        return int(text)
    except ValueError:
        raise SettingsError(f"{name} is {text!r}; it must be a whole number, for example {name}={default}") from None


def _in_range(name: str, value: int, lower: int, upper: int) -> None:
    if not lower <= value <= upper:
        raise SettingsError(f"{name} is {value}; it must lie in [{lower}, {upper}]")
