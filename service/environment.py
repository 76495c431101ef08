"""Finds environment variables that begin with ``WINGFIT_`` and that nothing reads."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from wingfit.records.errors import nearest

PREFIX = "WINGFIT_"
# Variables that other parts of wingfit read, and that may also be set for a server.
OF_CLIENTS = ("URL", "API_KEY")
OF_COMPOSE = ("CPUS_PER_WORKER", "WORKER_MEMORY", "API_MEMORY", "HEAD_MEMORY", "PIDS", "IMAGE")
OF_SLURM = ("VENV", "STATE", "SCRATCH", "BACKUP_SECONDS", "RAY_PORT", "RAY_OPTIONS", "HEAD_CPUS")
OF_TESTS = ("FAIL_POINT", "TEST_NODE", "FUZZ_GOOD", "LANES")
OF_OTHERS = frozenset(f"{PREFIX}{name}" for name in (*OF_CLIENTS, *OF_COMPOSE, *OF_SLURM, *OF_TESTS))
# Kubernetes sets these in every container for each Service whose name begins with "wingfit".
OF_KUBERNETES = re.compile(
    rf"{PREFIX}(\w+_)?(SERVICE_HOST|SERVICE_PORT(_\w+)?|PORT_\d+_(TCP|UDP|SCTP)(_(PROTO|PORT|ADDR))?)=.*"
    rf"|{PREFIX}\w+_PORT=(tcp|udp|sctp)://.*"
)


def given(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the variables that begin with ``WINGFIT_``, with surrounding spaces removed; empty ones are left out."""
    return {key: value.strip() for key, value in environment.items() if key.startswith(PREFIX) and value.strip()}


def unknown(read: Mapping[str, str], settings: Iterable[str]) -> list[str]:
    """Return those of the variables ``read`` that are neither ``settings`` of the server nor used elsewhere.

    Each name is followed by a similar known one, in parentheses.
    """
    known = {*settings, *OF_OTHERS}
    return [
        f"{name} ({nearest(name, sorted(known))})"
        for name, value in sorted(read.items())
        if name not in known and not OF_KUBERNETES.fullmatch(f"{name}={value}")
    ]
