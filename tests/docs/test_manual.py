"""The manual is built without a warning, its pages load nothing from elsewhere, and its search works on files."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import wingfit
from docs.generate.effect_pages import ROOT
from docs.manual import __main__ as manual
from docs.manual import python
from docs.manual.additions import place_of
from tests.service.pages.browsing import chromium

if TYPE_CHECKING:
    from playwright.sync_api import Browser

# of the theme and of MyST, for a Sphinx that we do not admit yet
pytestmark = pytest.mark.filterwarnings("ignore::sphinx.deprecation.RemovedInSphinx11Warning")
PAGES = (
    "index.html",
    "docs/gallery.html",
    "docs/effects/clap_and_peel.html",
    "reference/python/rigs.html",
    "reference/commands.html",
)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The manual, built once; a warning, such as one of a broken link or anchor, fails the build."""
    out = tmp_path_factory.mktemp("manual")
    assert manual.build(out) == 0, "the warnings above"
    return out


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as started:
        yield started


def test_every_page_of_the_documents_is_in_the_manual(built: Path) -> None:
    documents = [path.relative_to(ROOT) for path in (ROOT / "docs").rglob("*.md")]
    missing = [str(path) for path in documents if not (built / path.with_suffix(".html")).is_file()]
    assert not missing


def test_links_to_files_open_them_and_anchors_are_those_of_code_hosts(built: Path) -> None:
    rendered = (ROOT / "docs" / "gallery" / "wing-named.html").read_text(encoding="utf-8")
    assert (built / "docs" / "gallery" / "wing-named.html").read_text(encoding="utf-8") == rendered
    assert 'href="gallery/wing-named.html"' in (built / "docs" / "gallery.html").read_text(encoding="utf-8")
    assert 'href="../README.html#from-a-file-to-a-dataset"' in (built / "docs" / "start.html").read_text(
        encoding="utf-8"
    )
    assert 'href="../deploy/slurm/wingfit.sbatch"' in (built / "docs" / "deployment.html").read_text(encoding="utf-8")


def test_links_read_as_titles_where_their_text_is_the_name_of_a_file(built: Path) -> None:
    page = (built / "README.html").read_text(encoding="utf-8")
    assert re.search(r'href="docs/diagnosis\.html"><span class="std std-doc">Diagnosis', page)
    assert re.search(r'href="docs/importing\.html#a-whole-dataset"><span class="std std-ref">A whole dataset<', page)
    for path in built.rglob("*.html"):
        bare = re.findall(r"<a [^>]*>(?:<[^>]*>)*([\w./-]+\.md)<", path.read_text(encoding="utf-8"))
        assert not bare, (path.relative_to(built), bare)


def test_the_references_name_commands_calls_and_python(built: Path) -> None:
    for page, words in {
        "reference/commands.html": "wingfit diagnose [OPTIONS]",
        "reference/rest.html": 'id="post-v1-diagnoses"',
        "reference/python/diagnosing.html": 'id="wingfit.diagnose"',
        "reference/glossary.html": "nominal model",
    }.items():
        assert words in (built / page).read_text(encoding="utf-8"), page


def test_a_public_name_on_no_page_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wingfit.__all__", [*wingfit.__all__, "unlisted"])
    with pytest.raises(ValueError, match=r"one page of the manual.*'unlisted'"):
        python.pages()


@pytest.mark.parametrize(
    ("target", "place"),
    [
        ("../deploy/slurm/wingfit.sbatch", "deploy/slurm/wingfit.sbatch"),
        ("gallery/wing-named.html#top", "docs/gallery/wing-named.html"),
        ("effects/", "docs/effects"),
        ("effects.md", None),
        ("no-such-file.csv", None),
        ("../../../etc", None),
        ("#heading", None),
        ("figures", None),
    ],
)
def test_only_files_of_the_repository_are_linked(target: str, place: str | None) -> None:
    found = place_of("docs/page", target)
    assert (found and found.as_posix()) == place


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_pages_opened_as_files_are_accessible_and_load_nothing_from_elsewhere(
    built: Path, browser: Browser, scheme: str
) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="pip install -e '.[dev]'")
    context = browser.new_context(color_scheme=scheme, viewport={"width": 390, "height": 780})  # type: ignore[arg-type]
    page = context.new_page()
    wrong: list[str] = []
    page.on("console", lambda said: wrong.append(said.text) if said.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda one: None if one.url.startswith(("file:", "data:")) else wrong.append(one.url))
    for name in PAGES:
        page.goto((built / name).as_uri())
        assert not wrong, f"{name}: {wrong}"
        assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth"), f"{name} is too wide"
        # Without "preload", for which axe reads the style sheets, what a page opened as a file may not.
        found = axe.Axe().run(page, options={"preload": False}).response["violations"]
        assert not [(one["id"], one["nodes"][0]["html"]) for one in found], name
    context.close()


def test_the_search_works_on_files(built: Path, browser: Browser) -> None:
    page = browser.new_page()
    wrong: list[str] = []
    page.on("console", lambda said: wrong.append(said.text) if said.type == "error" else None)
    page.goto((built / "search.html").as_uri() + "?q=added+mass")
    result = page.locator("#search-results a", has_text="Added mass").first
    result.click()
    assert page.locator("h1").inner_text().startswith("Added mass")
    assert not wrong
    page.close()
