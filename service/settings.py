"""Settings of the service, read from environment variables that begin with ``WINGFIT_``."""

from __future__ import annotations

import ipaddress
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Literal, get_args

from wingfit.service import environment
from wingfit.service.limits import MOST_WORKERS

LogFormat = Literal["text", "json"]
EvaluatorKind = Literal["in_process", "processes", "ray"]
LOOPBACK_NAMES = ("localhost", "127.0.0.1", "::1")
YES = ("1", "true", "yes", "y", "on")
# In ASCII: int() also takes the digits of other scripts, underscores, and texts of any length.
WHOLE_NUMBER = re.compile(r"[+-]?[0-9]{1,18}")
HOST_NAME = re.compile(r"[a-z0-9_]([a-z0-9_.-]*[a-z0-9_])?\.?")
NO = ("0", "false", "no", "n", "off")


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
        max_runs: jobs computed at the same time (``WINGFIT_MAX_RUNS``).
        max_runs_per_owner: of them of one owner of keys (``WINGFIT_MAX_RUNS_PER_OWNER``); None: all.
        max_starts: starts without progress after which a job is given up, where each ended with the server
            (``WINGFIT_MAX_STARTS``).
        max_active: jobs of one owner that have not ended (``WINGFIT_MAX_ACTIVE``).
        max_stored_mb: MB of archives of one owner (``WINGFIT_MAX_STORED_MB``).
        keep_days: days after which runs and diagnoses that have ended are deleted (``WINGFIT_KEEP_DAYS``); None: never.
        log: text, or json, one object a line and requests as well (``WINGFIT_LOG``).
        require_keys: ask for an API key also on loopback (``WINGFIT_REQUIRE_KEYS=1``).
        allow_remote: listen on other addresses than loopback without keys (``WINGFIT_ALLOW_REMOTE=1``).
        allowed_hosts: host names that requests may carry (loopback names and ``WINGFIT_ALLOWED_HOSTS``).
    """

    data: Path
    host: str = "127.0.0.1"
    port: int = 8321
    evaluator: EvaluatorKind = "ray"
    workers: int | None = None
    ray_address: str | None = None
    max_runs: int = 2
    max_runs_per_owner: int | None = None
    max_starts: int = 3
    max_active: int = 200
    max_stored_mb: int = 10_000
    keep_days: int | None = None
    log: LogFormat = "text"
    require_keys: bool = False
    allow_remote: bool = False
    allowed_hosts: tuple[str, ...] = LOOPBACK_NAMES

    def __post_init__(self) -> None:
        _in_range("WINGFIT_PORT", self.port, 0, 65535)
        _in_range("WINGFIT_MAX_RUNS", self.max_runs, 1, 64)
        _in_range("WINGFIT_MAX_STARTS", self.max_starts, 1, 1_000_000)
        _in_range("WINGFIT_MAX_ACTIVE", self.max_active, 1, 100_000)
        _in_range("WINGFIT_MAX_STORED_MB", self.max_stored_mb, 1, 10**9)
        if self.max_runs_per_owner is not None:
            _in_range("WINGFIT_MAX_RUNS_PER_OWNER", self.max_runs_per_owner, 1, 64)
        if self.keep_days is not None:
            _in_range("WINGFIT_KEEP_DAYS", self.keep_days, 1, 36_500)
        if self.workers is not None:
            _in_range("WINGFIT_WORKERS", self.workers, 1, MOST_WORKERS)
        if self.evaluator not in get_args(EvaluatorKind):
            raise SettingsError(
                f"WINGFIT_EVALUATOR is {self.evaluator!r}; it must be one of {', '.join(get_args(EvaluatorKind))}"
            )
        if self.ray_address is not None and self.evaluator != "ray":
            raise SettingsError(
                f"WINGFIT_RAY_ADDRESS is {self.ray_address!r}, but WINGFIT_EVALUATOR is {self.evaluator!r}: "
                "set that to ray, or unset the address"
            )
        if self.log not in get_args(LogFormat):
            raise SettingsError(f"WINGFIT_LOG is {self.log!r}; it must be one of {', '.join(get_args(LogFormat))}")
        if self.allow_remote and self.require_keys:
            raise SettingsError(
                "WINGFIT_ALLOW_REMOTE=1 is for a server without keys, WINGFIT_REQUIRE_KEYS=1 for one with: unset one"
            )

    @classmethod
    def from_env(cls, env: Mapping[str, str] | None = None) -> Settings:
        """Settings from ``env`` (default: the environment of the process); an empty value counts as unset.

        Raises SettingsError for a value that cannot be, and for a ``WINGFIT_`` variable that nothing reads.
        """
        read = environment.given(os.environ if env is None else env)
        _refuse_unknown(read)
        return cls(
            data=_folder(read.get("WINGFIT_DATA", "wingfit-data")),
            host=read.get("WINGFIT_HOST", cls.host),
            port=_integer(read, "WINGFIT_PORT", cls.port),
            evaluator=read.get("WINGFIT_EVALUATOR", cls.evaluator),  # type: ignore[arg-type]  # checked above
            workers=_some(read, "WINGFIT_WORKERS"),
            ray_address=read.get("WINGFIT_RAY_ADDRESS"),
            max_runs=_integer(read, "WINGFIT_MAX_RUNS", cls.max_runs),
            max_runs_per_owner=_some(read, "WINGFIT_MAX_RUNS_PER_OWNER"),
            max_starts=_integer(read, "WINGFIT_MAX_STARTS", cls.max_starts),
            max_active=_integer(read, "WINGFIT_MAX_ACTIVE", cls.max_active),
            max_stored_mb=_integer(read, "WINGFIT_MAX_STORED_MB", cls.max_stored_mb),
            keep_days=_some(read, "WINGFIT_KEEP_DAYS"),
            log=read.get("WINGFIT_LOG", cls.log),  # type: ignore[arg-type]  # checked above
            require_keys=_yes(read, "WINGFIT_REQUIRE_KEYS"),
            allow_remote=_yes(read, "WINGFIT_ALLOW_REMOTE"),
            allowed_hosts=LOOPBACK_NAMES + _hosts(read.get("WINGFIT_ALLOWED_HOSTS", "")),
        )

    @property
    def keys(self) -> bool:
        """Whether calls need an API key: wherever other machines can reach the server, unless told otherwise."""
        return self.require_keys or not (self.allow_remote or is_loopback(self.host))

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


def _refuse_unknown(read: Mapping[str, str]) -> None:
    """SettingsError for names that nothing reads: a misspelt setting would be ignored in silence."""
    names = [f"{environment.PREFIX}{field.name.upper()}" for field in fields(Settings)]
    unknown = environment.unknown(read, names)
    if unknown:
        raise SettingsError(
            f"the environment has what is no setting of wingfit: {', '.join(unknown)}; correct or unset it"
        )


def _hosts(text: str) -> tuple[str, ...]:
    """Host names with commas between; SettingsError for one that no request can match."""
    names = tuple(name.strip().lower() for name in text.split(",") if name.strip())
    for name in names:
        if not (HOST_NAME.fullmatch(name) or _is_address(name)):
            raise SettingsError(
                f"WINGFIT_ALLOWED_HOSTS names {name!r}, which no request can match; write host names or IP addresses "
                "without scheme, port, path, brackets or wildcard, with commas between"
            )
    return names


def _is_address(text: str) -> bool:
    try:
        return bool(ipaddress.ip_address(text))
    except ValueError:
        return False


def _folder(text: str) -> Path:
    try:
        text.encode()
        return Path(text).expanduser()
    except (UnicodeEncodeError, RuntimeError) as error:
        raise SettingsError(
            f"WINGFIT_DATA is {text!a}, which names no folder ({error}); write its whole path"
        ) from None


def _yes(read: Mapping[str, str], name: str) -> bool:
    text = read.get(name)
    if text is None or text.lower() in NO:
        return False
    if text.lower() in YES:
        return True
    raise SettingsError(f"{name} is {text!r}; it must be one of {', '.join(YES)} (yes) or {', '.join(NO)} (no)")


def _some(read: Mapping[str, str], name: str) -> int | None:
    return _integer(read, name, 1) if name in read else None


def _integer(read: Mapping[str, str], name: str, default: int) -> int:
    text = read.get(name)
    if text is None:
        return default
    if WHOLE_NUMBER.fullmatch(text):
        return int(text)
    remedy = ""
    if "://" in text:
        remedy = "; if Kubernetes set it for a Service of that name, set it yourself, or enableServiceLinks: false"
    raise SettingsError(f"{name} is {text!r}; it must be a whole number, for example {name}={default}{remedy}")


def _in_range(name: str, value: int, lower: int, upper: int) -> None:
    if not lower <= value <= upper:
        raise SettingsError(f"{name} is {value}; it must lie in [{lower}, {upper}]")
