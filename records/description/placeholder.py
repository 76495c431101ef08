"""Placeholders in a generated ``dataset.yaml``: texts where a value belongs, which validation refuses."""

from __future__ import annotations

_START = "FILL IN: "


def placeholder(what: str) -> str:
    """Return the placeholder of a value that the user must give; ``what`` says which, with its unit."""
    return f"{_START}{what}"


def missing(value: object) -> str | None:
    """Return what the placeholder ``value`` stands for; None if it is no placeholder."""
    return value.removeprefix(_START) if isinstance(value, str) and value.startswith(_START) else None
