"""The page of a server, used in a browser by the person of :mod:`benchmarks.data_in.person`."""

from __future__ import annotations

import shutil
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.data_in.person import Person

if TYPE_CHECKING:
    from playwright.sync_api import Page

    from benchmarks.data_in.minutes import Source

NAMES = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
SECONDS = 120.0
SHOWN = "!document.getElementById('import-result').hidden"
STORED = "location.hash.startsWith('#dataset=') && document.body.innerText.includes('Recordings')"
QUESTIONS = "[...document.querySelectorAll('#import-asked .field:not(.answered)')].map((node) => node.dataset.option)"
# The text that is shown, rows of tables with tabs between their cells; entries of closed lists are not shown.
TEXT = """(() => {
  const texts = [];
  const walk = (node) => {
    if (node.nodeType === Node.TEXT_NODE) return node.data.trim() && texts.push(node.data.trim());
    if (node.nodeType !== Node.ELEMENT_NODE || !node.checkVisibility()) return null;
    if (["SELECT", "SCRIPT", "STYLE", "TEXTAREA"].includes(node.tagName)) return null;
    const cells = node.tagName === "TR" ? [...node.cells].map((cell) => cell.innerText.trim() || "-") : null;
    if (cells) return texts.push(cells.join("\\t"));
    return node.childNodes.forEach(walk);
  };
  walk(document.querySelector("main"));
  return texts.join("\\n");
})()"""


class Walk:
    """A page, and the person who uses it: reads what is new after each step, and waits until it is there."""

    def __init__(self, page: Page, person: Person) -> None:
        self.page, self.person = page, person
        self._seen = Counter[str]()

    def until(self, condition: str) -> None:
        """Wait until ``condition`` holds in the page; then read the lines that were not there before."""
        began = time.monotonic()
        # Polled from here: waiting inside the page needs eval, which its content security policy forbids.
        while not self.page.evaluate(condition):
            if time.monotonic() - began > SECONDS:
                raise RuntimeError(f"not within {SECONDS:g} s: {condition}; {self.page.evaluate(TEXT)[-2000:]}")
            self.page.wait_for_timeout(20)
        self.person.waits(time.monotonic() - began)
        lines = Counter(str(self.page.evaluate(TEXT)).splitlines())
        self.person.reads("\n".join((lines - self._seen).elements()))
        self._seen |= lines

    def click(self, selector: str) -> None:
        """Click on an element."""
        self.person.clicks_on()
        self.page.click(selector)

    def select(self, selector: str, value: str) -> None:
        """Open a list, and choose an entry."""
        self.person.clicks_on(2)
        self.person.reads(str(self.page.eval_on_selector(selector, "(node) => node.innerText")))
        self.page.select_option(selector, value)


def walked(data: Path, source: Source, url: str, person: Person, result: dict[str, Any]) -> Person | None:
    """Make a dataset of the file on the page; None without a browser, which ``result`` notes."""
    with _browser() as page:
        if page is None:
            note = "page: there is no playwright, or no chromium"
            result["skipped"] += [] if note in result["skipped"] else [note]
            return None
        walk = Walk(page, person)
        person.clicks_on()  # the address that 'wingfit serve' prints
        page.goto(url)
        walk.until("document.querySelector(\"a[href='#import']\") !== null")
        walk.click("a[href='#import'] >> nth=0")
        walk.until("document.getElementById('import-file') !== null")
        person.clicks_on(3)  # Choose a file; the file; Open
        page.set_input_files("#import-file", data / source.file)
        _answer(walk, source)
        _store(walk, source)
    return person


def _answer(walk: Walk, source: Source) -> None:
    """Answer the questions of the form until the tracks are shown; first the axes, if the file shows a wing."""
    known = {"unit": source.unit, "time_unit": source.time_unit, "rows": source.also, "repeated": "gaps"}
    walk.until(f"{SHOWN} || {QUESTIONS}.length > 0")
    while unanswered := walk.page.evaluate(QUESTIONS):
        for option in unanswered:
            place = f"#import-asked [name={option}]"
            if walk.page.get_attribute(place, "type") == "checkbox":
                walk.click(place)
            else:
                first = "(node) => [...node.options].find((one) => one.value).value"
                walk.select(place, known.get(option) or str(walk.page.eval_on_selector(place, first)))
            walk.until(f"!{QUESTIONS}.includes('{option}')")
    walk.until(SHOWN)
    if source.axes:
        for part in source.axes.split(", "):
            axis, direction = part.split()
            walk.select(f"#import-form [name=axis-{axis}]", direction)
        walk.until("document.getElementById('import-facts').textContent.includes('of the wing')")


def _store(walk: Walk, source: Source) -> None:
    page = walk.page
    if not source.axes:
        walk.click("#import-series")
        walk.until(STORED)
        return
    walk.click("#import-describe")
    shown = "!document.getElementById('import-{}').hidden"
    walk.until(f"{shown.format('described')} || {shown.format('describe-errors')}")
    if page.is_visible("#import-describe-errors"):
        # The message lists the markers of one wing: these are ticked.
        names = page.inner_text("#import-describe-errors").rpartition(" ")[2].strip().split(",")
        walk.click("#import-none")
        for name in names:
            walk.click(f"[aria-label='Use {name}']")
        walk.click("#import-describe")
        walk.until(shown.format("described"))
    walk.click("#import-recording [type=submit]")
    walk.until("!document.getElementById('import-dataset-part').hidden")
    walk.click("#import-dataset [type=submit]")
    walk.until(STORED)


def looked(person: Person, address: str) -> None:
    """Open the page of a dataset and read it; without a browser, nothing is added."""
    with _browser() as page:
        if page is not None:
            page.goto(address)
            Walk(page, person).until(STORED)


@contextmanager
def _browser() -> Iterator[Page | None]:
    path = next((found for name in NAMES if (found := shutil.which(name))), None)
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        path = None
    if path is None:
        yield None
        return
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        yield browser.new_page(viewport={"width": 1280, "height": 900})
        browser.close()
