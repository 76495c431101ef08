"""Refuses a text where a list of names belongs: a text is a sequence too, of letters."""

from __future__ import annotations


def refuse_text(owner: object, *names: str) -> None:
    """Raise a TypeError if one of the attributes ``names`` of ``owner`` is a text instead of a sequence of names."""
    for name in names:
        value = getattr(owner, name)
        if isinstance(value, str):
            raise TypeError(f"{name} is the text {value!r}; give a sequence of names: ({value!r},)")
