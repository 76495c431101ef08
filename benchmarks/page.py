"""``python -m benchmarks.page``: measures the web page in Chromium, on a real server.

A dataset of forces is uploaded, calibrated and diagnosed with clicks alone. Then each page is opened in light and dark,
on a desktop and on a phone: its answer must be near the top, axe must find nothing, and the console must be silent. At
last the page is opened over many runs. Takes a few minutes.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from shutil import which
from typing import TYPE_CHECKING, Any, Literal

from benchmarks.common import machine
from benchmarks.common.files import archive
from benchmarks.common.server_process import Server
from benchmarks.load.filling import fill

if TYPE_CHECKING:
    from playwright.sync_api import Browser, ConsoleMessage, Page, ViewportSize

Scheme = Literal["light", "dark"]
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
DATASET = "delfly"
MANY_RUNS, EACH = 10_000, 2  # runs, and generations of each
LONGEST_S = 600.0
TRIES = 3
DESKTOP: ViewportSize = {"width": 1280, "height": 900}
PHONE: ViewportSize = {"width": 390, "height": 780}
SCHEMES: tuple[Scheme, ...] = ("light", "dark")
MOVED = (
    "performance.getEntries().reduce((sum, one) => sum + (one.transferSize || 0), 0)"  # bytes, with the drawing library
)
SETTLED_MS = 4000.0  # until the figures are drawn
# What answers the question of a page: a badge or sentence, and the first picture.
ANSWERS = {
    "run": ("#run-fit", "#beats"),
    "diagnosis": ("#report >> h1", "#report >> svg[role=img]"),
    "dataset": ("#dataset-name", "#forces-view"),
    "diagnoses": ("#listing-table tbody tr",),
}


@dataclass
class Found:
    """What the browser found: violations of axe, errors on the console, and the largest page in bytes moved."""

    violations: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    bytes_of: dict[str, int] = field(default_factory=dict)


@dataclass
class Watch:
    """Notes errors of a page, ``where``, in ``found``."""

    where: str
    found: Found

    def message(self, message: ConsoleMessage) -> None:
        """Note an error on the console."""
        if message.type == "error":
            self.found.errors.append(f"{self.where}: {message.text}")

    def failure(self, error: object) -> None:
        """Note an error that no script caught."""
        self.found.errors.append(f"{self.where}: {error}")


class Clicks:
    """Clicks on a page, counted."""

    def __init__(self, page: Page) -> None:
        self.page, self.count = page, 0

    def on(self, selector: str, timeout_s: float = 60.0) -> None:
        """Click on the element ``selector`` when it is there."""
        self.page.click(selector, timeout=1e3 * timeout_s)
        self.count += 1


def main() -> None:
    """Measure, and print the figures; the last line of output is one JSON object."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.page", description=__doc__)
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line (always printed)")
    parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="wf-") as scratch:
        figures = measured(Path(scratch))
    print(json.dumps(figures | {"processor": machine.cpu(), "commit": machine.commit()}))
    sys.exit(0 if not figures["axe_violations"] and not figures["console_errors"] else 1)


def measured(folder: Path) -> dict[str, Any]:
    """Return the figures; ``folder`` holds the server's data."""
    from playwright.sync_api import sync_playwright  # needed here alone

    path = next((there for name in BROWSERS if (there := which(name))), None)
    if path is None:
        sys.exit("chromium is not installed; install it, e.g. apt-get install chromium")
    packed = folder / f"{DATASET}.zip"
    packed.write_bytes(archive(DATASET))
    server, found = Server(folder, "processes"), Found()
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        server.start()
        try:
            clicks, pages = _worked(browser, server, packed)
            tops = {name: _top(browser, server, pages[name], selectors) for name, selectors in ANSWERS.items()}
            for scheme in SCHEMES:
                for size in (DESKTOP, PHONE):
                    _looked_at(browser, server, pages, scheme, size, found)
        finally:
            server.stop()
        fill(folder / "data", MANY_RUNS, EACH, EACH)
        server.start()
        try:
            seconds = {one: _seconds(browser, server, one) for one in ("", "runs", "runs&sort=fit&order=desc")}
        finally:
            server.stop()
        browser.close()
    largest = max(found.bytes_of, key=lambda one: found.bytes_of[one])
    return {
        "answer_px_from_top": max(tops.values()),
        "answers": tops,
        "clicks_upload_to_finding": clicks,
        f"seconds_usable_{MANY_RUNS}_runs": max(seconds.values()),
        "seconds": seconds,
        "axe_violations": len(found.violations),
        "violations": sorted(set(found.violations)),
        "console_errors": len(found.errors),
        "errors": found.errors[:5],
        "largest_page_kb": round(found.bytes_of[largest] / 1e3),
        "largest_page": largest,
    }


def _worked(browser: Browser, server: Server, packed: Path) -> tuple[int, dict[str, str]]:
    """Go from the upload to a finding with clicks; return their number, and the addresses of the pages seen."""
    page = browser.new_context(viewport=DESKTOP).new_page()
    clicks = Clicks(page)
    page.goto(_address(server, ""))
    with page.expect_file_chooser() as chooser:
        clicks.on("#pick-file")
    chooser.value.set_files(packed)
    page.wait_for_selector("#submit-dialog[open]", timeout=1e3 * LONGEST_S)
    clicks.on("#submit-form [type=submit]")
    page.wait_for_selector("#run-fit:not([hidden])", timeout=1e3 * LONGEST_S)
    run = page.evaluate("location.hash").removeprefix("#")
    clicks.on("#diagnose-run")
    clicks.on("#diagnose-form [type=submit]")
    page.wait_for_selector("#report >> h1", timeout=1e3 * LONGEST_S)
    diagnosis = page.evaluate("location.hash").removeprefix("#")
    page.goto(_address(server, "datasets"))
    link = page.wait_for_selector("#listing-table tbody a[href^='#dataset=']")
    dataset = (link.get_attribute("href") or "").removeprefix("#") if link else ""
    page.context.close()
    lists = {name: name for name in ("runs", "diagnoses", "datasets", "effects", "import", "films")}
    return clicks.count, {"home": "", "run": run, "diagnosis": diagnosis, "dataset": dataset, **lists}


def _address(server: Server, hash_: str) -> str:
    return f"http://127.0.0.1:{server.port}/" + (f"#{hash_}" if hash_ else "")


def _top(browser: Browser, server: Server, address: str, selectors: tuple[str, ...]) -> int:
    """Return how far from the top of the page the last of the elements ``selectors`` begins, in pixels."""
    page = browser.new_context(viewport=DESKTOP).new_page()
    page.goto(_address(server, address))
    tops = []
    for selector in selectors:
        page.wait_for_selector(selector, timeout=1e3 * LONGEST_S)
        page.wait_for_timeout(1500)  # until what is above it has its height
        box = page.locator(selector).first.bounding_box()
        tops.append(box["y"] if box else float("inf"))
    page.context.close()
    return round(max(tops))


def _looked_at(
    browser: Browser, server: Server, pages: dict[str, str], scheme: Scheme, size: ViewportSize, found: Found
) -> None:
    """Open each page with ``scheme`` and ``size``, and add what axe, console and network say to ``found``."""
    from axe_playwright_python.sync_playwright import Axe  # needed here alone

    for name, address in pages.items():
        context = browser.new_context(viewport=size, color_scheme=scheme)
        page = context.new_page()
        watch = Watch(f"{name}, {scheme}, {size['width']} px", found)
        page.on("console", watch.message)
        page.on("pageerror", watch.failure)
        page.goto(_address(server, address))
        page.wait_for_timeout(SETTLED_MS)
        found.violations += [f"{watch.where}: {one['id']}" for one in Axe().run(page).response["violations"]]
        found.bytes_of[name] = max(found.bytes_of.get(name, 0), int(page.evaluate(MOVED)))
        context.close()


def _seconds(browser: Browser, server: Server, address: str) -> float:
    """Return the seconds from opening ``address`` until its rows can be clicked, the least of TRIES."""
    ready = "#newest-runs .card" if address == "" else "#listing-table tbody tr a"
    page = browser.new_context(viewport=DESKTOP).new_page()
    taken = []
    for _ in range(TRIES):
        page.goto("about:blank")
        began = time.monotonic()
        page.goto(_address(server, address))
        page.wait_for_selector(ready)
        taken.append(time.monotonic() - began)
    page.context.close()
    return round(min(taken), 2)


if __name__ == "__main__":
    main()
