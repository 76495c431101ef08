"""The committed gallery follows from its findings, and its texts from the verdicts."""

from __future__ import annotations

import pytest

from docs.generate import gallery
from docs.generate.effect_pages import filled

MOST_BYTES = 3_000_000


@pytest.mark.parametrize("name", gallery.ENTRIES)
def test_report_and_figure_follow_from_the_finding(name: str) -> None:
    for path, text in gallery.rendered(name).items():
        committed = path.read_text(encoding="utf-8")
        assert committed == text, f"run: python -m docs.generate.gallery --render ({path.name})"


@pytest.mark.parametrize("name", gallery.ENTRIES)
def test_the_verdict_is_the_one_described(name: str) -> None:
    assert gallery.stored(name).verdict == gallery.ENTRIES[name].verdict


def test_the_page_lists_every_finding() -> None:
    text = gallery.PAGE.read_text(encoding="utf-8")
    assert text == filled(text, {"gallery": gallery.gallery()}), "run: python -m docs.generate.gallery --render"


def test_the_gallery_holds_its_entries_alone_and_stays_small() -> None:
    files = list(gallery.FOLDER.iterdir())
    assert {path.name for path in files} == {
        f"{name}.{kind}" for name in gallery.ENTRIES for kind in ("json", "html", "svg")
    }
    assert sum(path.stat().st_size for path in files) < MOST_BYTES
