"""The library OpenCV, an optional one: it is loaded where it is needed, and its absence is explained."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from wingfit.records.errors import fail


def opencv() -> ModuleType:
    """Return the module cv2; DatasetError with the remedy if it is not installed."""
    try:
        return import_module("cv2")
    except ImportError:
        raise fail("cameras", None, "needs the library OpenCV: pip install 'wingfit[cameras]'") from None
