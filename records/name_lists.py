"""Refuses a text where a list of names belongs, as a text is a sequence too, of letters; and what is no mapping."""

from __future__ import annotations

from collections.abc import Mapping


def refuse_text(owner: object, *names: str) -> None:
    """Raise a TypeError if one of the attributes ``names`` of ``owner`` is a text instead of a sequence of names."""
    for name in names:
        value = getattr(owner, name)
        if isinstance(value, str | bytes):
            raise TypeError(f"{name} is the text {value!r}; give a sequence of names: ({value!r},)")


def refuse_no_mapping(owner: object, *names: str) -> None:
    """Raise a TypeError if one of the attributes ``names`` of ``owner`` is not a mapping of names to values."""
    for name in names:
        value = getattr(owner, name)
        if not isinstance(value, Mapping):
            raise TypeError(f"{name} is {value!r}; give a mapping of names to values, such as {{'name': 1.0}}")
