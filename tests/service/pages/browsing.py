"""A page in a browser, and what it said and asked for."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, ConsoleMessage, Page

    from tests.service.conftest import Api

NAMES = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
ARGUMENTS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
)
DRAWN = "document.getElementById('{}').data?.length > {}"


@contextmanager
def chromium() -> Iterator[Browser]:
    """A browser; the test is skipped where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="install playwright: pip install -e '.[dev]'")
    path = next((found for name in NAMES if (found := shutil.which(name))), None)
    if path is None:
        pytest.skip("no chromium to drive; install it, e.g. apt-get install chromium")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        yield browser
        browser.close()


@dataclass
class Seen:
    """A page and what it said and asked for."""

    page: Page
    base: str
    errors: list[str] = field(default_factory=list)
    foreign: list[str] = field(default_factory=list)

    @classmethod
    def watched(cls, page: Page, base: str) -> Self:
        """Note the page's errors and its requests to other origins from now on."""
        seen = cls(page, base)

        def note(message: ConsoleMessage) -> None:
            if message.type == "error":
                seen.errors.append(message.text)

        page.on("console", note)
        page.on("pageerror", lambda error: seen.errors.append(str(error)))
        own = (base, "data:", "blob:")
        page.on("request", lambda request: None if request.url.startswith(own) else seen.foreign.append(request.url))
        return seen

    def open(self, run_id: str | None = None) -> None:
        self.show(f"run={run_id}" if run_id else "")

    def show(self, address: str) -> None:
        """Open the page of ``address``, what stands after # in its URL."""
        self.page.goto(f"{self.base}/" + (f"#{address}" if address else ""))

    def data(self, figure: str, trace: int, name: str) -> list[Any]:
        """A coordinate of a trace, as Plotly draws it."""
        script = f"Array.from(document.getElementById('{figure}').data?.[{trace}]?.{name} ?? [])"
        return list(self.page.evaluate(script))

    def rows(self, table: str) -> list[list[str]]:
        """The texts of the cells of a table's body."""
        script = (
            f"[...document.querySelectorAll('#{table} tbody tr')].map((r) => [...r.cells].map((c) => c.textContent))"
        )
        return list(self.page.evaluate(script))

    def _holds(self, condition: str) -> bool:
        from playwright.sync_api import Error

        try:
            return bool(self.page.evaluate(condition))
        except Error as error:
            # The page is being loaded anew, or a part of it has not come yet.
            if "Execution context was destroyed" in str(error) or "properties of null" in str(error):
                return False
            raise

    def wait(self, condition: str, seconds: float = 60.0) -> None:
        # Polled from here: Playwright's own polling needs eval in the page, which the content policy rightly forbids.
        deadline = time.monotonic() + seconds
        while not self._holds(condition):
            assert time.monotonic() < deadline, f"not within {seconds:g} s: {condition}; errors: {self.errors}"
            self.page.wait_for_timeout(50)


def opened(browser: Browser, api: Api, **options: Any) -> Seen:
    """Return a watched page of the server behind ``api``, in a context with ``options``."""
    context = browser.new_context(**({"viewport": {"width": 1280, "height": 900}} | options))
    return Seen.watched(context.new_page(), str(api.client.base_url).rstrip("/"))


def check_curves(seen: Seen, curves: list[dict[str, Any]]) -> None:
    """The chart shows the curve that is chosen, first that with the largest misfit."""
    seen.wait(DRAWN.format("curve-plot", 2))
    options = seen.page.locator("#curve option").all_inner_texts()
    assert options == [f"{c['channel']} in {c['recording']}{' (held out)' * c['held_out']}" for c in curves]
    for k in (0, len(curves) - 1):
        seen.page.select_option("#curve", str(k))
        for trace, name in enumerate(("recorded", "nominal", "best")):
            assert seen.data("curve-plot", trace, "y") == pytest.approx(curves[k][name])
    assert "worst first" in seen.page.inner_text("#curves-note")
