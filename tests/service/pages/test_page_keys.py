"""The page of a server that asks for a key."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tests.service.auth.test_keys import bearer
from tests.service.conftest import made, toy_service
from tests.service.pages.browsing import Seen
from tests.service.processes import ServerProcess
from wingfit.service.auth import keys

if TYPE_CHECKING:
    from playwright.sync_api import Browser


def test_a_key_that_is_revoked_is_asked_for_and_its_user_goes_on(browser: Browser, tmp_path: Path) -> None:
    with toy_service(tmp_path / "data", require_keys=True) as (service, api):
        with service.database.write() as session:
            (first, secret), (_, second) = (keys.make(session, name, "ann", ("read", "write")) for name in ("a", "b"))
            key_id = first.id
        service.load_keys()
        seen = Seen.watched(browser.new_context().new_page(), str(api.client.base_url).rstrip("/"))
        page = seen.page
        seen.open()
        page.fill("#key-form [name=key]", secret)
        page.keyboard.press("Enter")
        seen.wait("document.getElementById('owner').textContent === 'ann'")
        seen.show("import")
        page.evaluate("document.body.dataset.same = 'yes'")
        with service.database.write() as session:
            keys.revoke(session, key_id)
        service.load_keys()
        assert seen.errors == []
        seen.show("runs")
        page.wait_for_selector("#key-dialog[open]")
        assert page.is_hidden("#away"), "the server answers"
        page.fill("#key-form [name=key]", second)
        page.keyboard.press("Enter")
        seen.wait("!document.getElementById('key-dialog').open")
        seen.wait("document.getElementById('listing-note').textContent === 'No runs yet.'")
        assert page.get_attribute("body", "data-same") == "yes", "what was on the page is still there"
        assert all("401" in error for error in seen.errors)
        page.context.close()


def test_a_key_is_asked_for_once_kept_from_scripts_and_forgotten(browser: Browser, tmp_path: Path) -> None:
    data = tmp_path / "data"
    secret = made(data, "ann", "read", "write")
    made(data, "boss", "admin")
    with ServerProcess(data, ("tests.service.toy_server", "0.02"), {"WINGFIT_REQUIRE_KEYS": "1"}) as server:
        server.client.headers.update(bearer(secret))
        server.api.upload(name="of ann")
        base = f"http://127.0.0.1:{server.port}"
        seen = Seen.watched(browser.new_context(viewport={"width": 1000, "height": 700}).new_page(), base)
        page = seen.page
        seen.open()
        page.wait_for_selector("#key-dialog[open]")
        page.keyboard.press("Escape")
        assert page.is_visible("#key-form")
        assert seen.errors == []
        page.fill("#key-form [name=key]", "wingfit_wrong")
        page.keyboard.press("Enter")
        page.wait_for_selector("#key-errors:not([hidden])")
        assert "not a key of this server" in page.inner_text("#key-errors")
        seen.errors.clear()  # the browser reports the refusal
        page.fill("#key-form [name=key]", secret)
        page.keyboard.press("Enter")
        seen.wait("document.querySelector('#newest-datasets').textContent.includes('of ann')")
        assert page.inner_text("#owner") == "ann"
        assert page.evaluate("document.cookie") == ""
        page.reload()
        seen.wait("document.querySelector('#newest-datasets').textContent.includes('of ann')")
        page.click("#sign-out")
        page.wait_for_selector("#key-dialog[open]")
        assert "of ann" not in page.inner_text("body")
        assert (seen.errors, seen.foreign) == ([], [])
        page.context.close()
