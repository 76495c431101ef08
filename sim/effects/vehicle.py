"""A vehicle about to be simulated: what effects may change."""

from __future__ import annotations


class VehicleScene:
    """To come."""
