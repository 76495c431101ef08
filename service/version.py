"""Version of the installed package."""

from __future__ import annotations

from functools import cache
from importlib.metadata import PackageNotFoundError, version


@cache
def wingfit_version() -> str:
    """Version of the installed package."""
    try:
        return version("wingfit")
    except PackageNotFoundError:
        return "0+uninstalled"
