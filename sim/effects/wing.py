"""A wing about to be simulated: what effects may change."""

from __future__ import annotations


class WingScene:
    """To come."""
