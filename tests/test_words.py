"""No banned phrase is left: see ``python -m benchmarks.house --list``."""

from __future__ import annotations

from tests.oracles import house


def test_no_banned_phrase_is_left() -> None:
    places = [f"{place.file}:{place.line}: {place.phrase!r}; say: {place.instead}" for place in house.idioms()]
    assert not places, "\n".join(places)
