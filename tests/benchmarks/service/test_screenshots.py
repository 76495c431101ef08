"""Screenshots are taken of every page that the web page has."""

from __future__ import annotations

import re
from pathlib import Path

from benchmarks import screenshots

APP = Path(__file__).parents[3] / "service" / "web" / "app.js"
STATED = re.compile(r"const (LISTINGS|LISTS|PAGES) = \[(.*?)\]")
ADDRESS = re.compile(r"\"page-[a-z-]+\": \(f?\"([a-z]*)")


def test_every_page_of_the_web_page_is_in_the_list() -> None:
    stated = STATED.findall(APP.read_text(encoding="utf-8"))
    assert len(stated) == 3
    pages = {name for _, names in stated for name in re.findall(r"\"([a-z]+)\"", names)}
    taken = set(ADDRESS.findall(Path(screenshots.__file__).read_text(encoding="utf-8")))
    assert pages <= taken
    assert "" in taken, "the start page"
