"""Tables, axes, phones and colours of the page of a run on forces."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import pytest

from tests.service.conftest import Api
from tests.service.pages.browsing import DRAWN, Seen
from tests.service.pages.forces.conftest import base

if TYPE_CHECKING:
    from playwright.sync_api import Browser


def test_tables_are_seen_in_full_and_axes_have_ticks(browser: Browser, api: Api, local: str) -> None:
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    seen = Seen.watched(context.new_page(), base(api))
    seen.open(local)
    seen.wait(DRAWN.format("by-pitch", 8))
    seen.wait(DRAWN.format("history", 1))
    for table in ("law", "agreement", "averages"):
        frame = f"document.getElementById('{table}').parentElement"
        needed, there = seen.page.evaluate(f"[{frame}.scrollWidth, {frame}.clientWidth]")
        assert needed <= there, table
    for axis, least in (("x", 2), ("y", 3)):
        layout = f"document.getElementById('history').layout.{axis}axis"
        ticks, (low, high) = seen.page.evaluate(f"{layout}.tickvals"), seen.page.evaluate(f"{layout}.range")
        inside = [t for t in ticks if low <= (t if axis == "x" else math.log10(t)) <= high]
        assert len(inside) >= least, axis
        shown = ".xtick" if axis == "x" else ".ytick"
        names = seen.page.evaluate(f"[...document.querySelectorAll('#history {shown} text')].map((t) => t.textContent)")
        assert len(set(names)) == len(names) >= least, names
    context.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_needs_no_sideways_scrolling(browser: Browser, api: Api, local: str, scheme: Any) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 800}, color_scheme=scheme)
    seen = Seen.watched(context.new_page(), base(api))
    seen.open(local)
    seen.wait(DRAWN.format("spectrum-1", 1))
    seen.wait(DRAWN.format("by-pitch", 8))
    assert seen.page.evaluate("document.documentElement.scrollWidth") <= 390
    ink = seen.page.evaluate("document.getElementById('beat-0').data[2].line.color")
    assert (int(ink[1:3], 16) > 128) == (scheme == "dark")
    assert (seen.errors, seen.foreign) == ([], [])
    context.close()


def test_figures_follow_a_change_of_colours(browser: Browser, api: Api, local: str) -> None:
    context = browser.new_context(color_scheme="light")
    seen = Seen.watched(context.new_page(), base(api))
    seen.open(local)
    seen.wait(DRAWN.format("by-pitch", 8))
    seen.wait(DRAWN.format("beat-0", 2))
    beat = seen.page.evaluate("document.getElementById('beat-0').data[3].line.color")
    dots = seen.page.evaluate("document.getElementById('by-pitch').data[2].marker.color")
    seen.page.emulate_media(color_scheme="dark")
    seen.wait(f"document.getElementById('beat-0').data[3].line.color !== {json.dumps(beat)}")
    seen.wait(f"document.getElementById('by-pitch').data[2].marker.color !== {json.dumps(dots)}")
    context.close()
