"""In place of :mod:`wingfit.sim.kernels.laws`: laws of flexible wings, which an exported vehicle does not simulate."""

from __future__ import annotations

from typing import Any

BEFORE, AFTER = 0, 1


def strip_port(frame: Any) -> Any:
    """Raise NotImplementedError: the law of a flexible wing runs only compiled."""
    raise NotImplementedError(f"this file simulates a vehicle; it has no port {frame!r} of a flexible wing")


connector_port = point_port = strip_port
