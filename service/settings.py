"""Settings of the service, read from environment variables that begin with ``WINGFIT_``."""

from __future__ import annotations

import ipaddress
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal, get_args

from wingfit.service import environment
from wingfit.service.limits import MOST_WORKERS

LogFormat = Literal["text", "json"]
EvaluatorKind = Literal["in_process", "processes", "ray"]
LOOPBACK_NAMES = ("localhost", "127.0.0.1", "::1")
YES, NO = ("1", "true", "yes", "y", "on"), ("0", "false", "no", "n", "off")
# ASCII digits only: int() would also accept the digits of other scripts, underscores, and texts of any length.
WHOLE_NUMBER = re.compile(r"[+-]?[0-9]{1,18}")
HOST_NAME = re.compile(r"[a-z0-9_]([a-z0-9_.-]*[a-z0-9_])?\.?")
DEFAULT_FOLDER = "wingfit-data"
# The smallest and the largest value of each whole number, the choices of each name, and the yes-or-no settings.
RANGES = {
    "port": (0, 65535),
    "workers": (1, MOST_WORKERS),
    "max_runs": (1, 64),
    "max_runs_per_owner": (1, 64),
    "max_starts": (1, 1_000_000),
    "max_active": (1, 100_000),
    "max_stored_mb": (1, 10**9),
    "max_film_mib": (1, 10**6),
    "max_films_mib": (1, 10**9),
    "keep_days": (1, 36_500),
}
CHOICES = {"evaluator": get_args(EvaluatorKind), "log": get_args(LogFormat)}
FLAGS = ("require_keys", "allow_remote")


class SettingsError(ValueError):
    """Raised for a setting with which the service cannot run; the message says what to change."""


@dataclass(frozen=True)
class Settings:
    """How the service runs.

    Attributes:
        data: folder of the database and its lock (``WINGFIT_DATA``).
        host: address to listen on (``WINGFIT_HOST``).
        port: TCP port (``WINGFIT_PORT``); 0 takes a free one.
        evaluator: what evaluates individuals (``WINGFIT_EVALUATOR``): in_process, processes or ray.
        workers: number of worker processes (``WINGFIT_WORKERS``); None: the evaluator decides.
        ray_address: address of a running Ray cluster (``WINGFIT_RAY_ADDRESS``); None: the server starts its own.
        max_runs: jobs computed at the same time (``WINGFIT_MAX_RUNS``).
        max_runs_per_owner: jobs of one owner computed at once (``WINGFIT_MAX_RUNS_PER_OWNER``); None: ``max_runs``.
        max_starts: a job fails after this many starts without progress that ended with a crash of the server
            (``WINGFIT_MAX_STARTS``).
        max_active: largest number of jobs of one owner that have not ended (``WINGFIT_MAX_ACTIVE``).
        max_stored_mb: largest total size of the datasets of one owner, MB (``WINGFIT_MAX_STORED_MB``).
        max_film_mib: largest video, MiB (``WINGFIT_MAX_FILM_MIB``).
        max_films_mib: largest total size of the videos of one owner, MiB (``WINGFIT_MAX_FILMS_MIB``).
        keep_days: days after which jobs that have ended are deleted (``WINGFIT_KEEP_DAYS``); None: never.
        log: text, or json, which has one object per line and every request (``WINGFIT_LOG``).
        require_keys: require an API key also on loopback (``WINGFIT_REQUIRE_KEYS=1``).
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
    max_film_mib: int = 4096
    max_films_mib: int = 65_536
    keep_days: int | None = None
    log: LogFormat = "text"
    require_keys: bool = False
    allow_remote: bool = False
    allowed_hosts: tuple[str, ...] = LOOPBACK_NAMES

    def __post_init__(self) -> None:
        for field, (lower, upper) in RANGES.items():
            value = getattr(self, field)
            if value is not None and not lower <= value <= upper:
                raise SettingsError(f"{_variable(field)} is {value}; it must lie in [{lower}, {upper}]")
        for field, choices in CHOICES.items():
            if (value := getattr(self, field)) not in choices:
                raise SettingsError(f"{_variable(field)} is {value!r}; it must be one of {', '.join(choices)}")
        if self.ray_address is not None and self.evaluator != "ray":
            raise SettingsError(
                f"WINGFIT_RAY_ADDRESS is {self.ray_address!r}, but WINGFIT_EVALUATOR is {self.evaluator!r}: "
                "set that to ray, or unset the address"
            )
        if self.allow_remote and self.require_keys:
            raise SettingsError(
                "WINGFIT_ALLOW_REMOTE=1 is for a server without keys, WINGFIT_REQUIRE_KEYS=1 for one with keys: unset "
                "one of them"
            )

    @classmethod
    def from_env(cls, env: Mapping[str, str] | None = None) -> Settings:
        """Return the settings in ``env`` (default: the environment of the process); an empty value counts as unset.

        Raises SettingsError for an invalid value, and for a ``WINGFIT_`` variable that nothing reads, because a
        misspelt setting would be ignored silently.
        """
        read = environment.given(os.environ if env is None else env)
        variables = {field.name: _variable(field.name) for field in fields(cls)}
        if unknown := environment.unknown(read, variables.values()):
            raise SettingsError(
                f"the environment has variables that are no setting of wingfit: {', '.join(unknown)}; correct or unset "
                "them"
            )
        read.setdefault("WINGFIT_DATA", DEFAULT_FOLDER)
        given = {field: read[variable] for field, variable in variables.items() if variable in read}
        return cls(**{field: _parsed(field, text) for field, text in given.items()})

    @property
    def keys(self) -> bool:
        """Whether calls require an API key: by default only where other machines can reach the server."""
        return self.require_keys or not (self.allow_remote or is_loopback(self.host))

    @property
    def url(self) -> str:
        """The address of the service for a browser on this machine."""
        host = self.host if is_loopback(self.host) else "localhost"
        return f"http://[{host}]:{self.port}/" if ":" in host else f"http://{host}:{self.port}/"


def is_loopback(host: str) -> bool:
    """Return whether ``host`` is an address of this machine that other machines cannot reach."""
    address = _address(host)
    return host == "localhost" if address is None else address.is_loopback


def _variable(field: str) -> str:
    return f"{environment.PREFIX}{field.upper()}"


def _parsed(field: str, text: str) -> Any:
    """Return the value of the setting ``field`` from its ``text``; SettingsError if the text is not a valid value."""
    if field in RANGES:
        return _integer(field, text)
    if field in FLAGS:
        return _flag(field, text)
    if field == "data":
        return _folder(text)
    return LOOPBACK_NAMES + _hosts(text) if field == "allowed_hosts" else text


def _hosts(text: str) -> tuple[str, ...]:
    """Return the host names in comma-separated ``text``; SettingsError for one that no request can match."""
    names = tuple(name.strip().lower() for name in text.split(",") if name.strip())
    for name in names:
        if not (HOST_NAME.fullmatch(name) or _address(name)):
            raise SettingsError(
                f"WINGFIT_ALLOWED_HOSTS names {name!r}, which no request can match; write host names or IP addresses "
                "without scheme, port, path, brackets or wildcard, with commas between"
            )
    return names


def _address(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(text)
    except ValueError:
        return None


def _folder(text: str) -> Path:
    try:
        text.encode()
        return Path(text).expanduser()
    except (UnicodeEncodeError, RuntimeError) as error:
        raise SettingsError(
            f"WINGFIT_DATA is {text!a}, which names no folder ({error}); write its whole path"
        ) from None


def _flag(field: str, text: str) -> bool:
    if text.lower() not in YES + NO:
        raise SettingsError(
            f"{_variable(field)} is {text!r}; it must be one of {', '.join(YES)} (yes) or {', '.join(NO)} (no)"
        )
    return text.lower() in YES


def _integer(field: str, text: str) -> int:
    if WHOLE_NUMBER.fullmatch(text):
        return int(text)
    variable, example, remedy = _variable(field), getattr(Settings, field) or RANGES[field][0], ""
    if "://" in text:
        remedy = "; if Kubernetes set it for a Service of that name, set it yourself, or enableServiceLinks: false"
    raise SettingsError(f"{variable} is {text!r}; it must be a whole number, for example {variable}={example}{remedy}")
