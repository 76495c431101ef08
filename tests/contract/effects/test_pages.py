"""Every effect has a file, a page with its law and its figure, and tests; no file and no page is without an effect."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from docs.generate.effect_pages import FOLDER, INDEX, files, filled, page_of
from wingfit.sim.effects.registry import EFFECTS

ROOT = Path(__file__).parents[3]
LINK = re.compile(r"\]\(([^)#:]+)\)")


@pytest.mark.parametrize("name", EFFECTS)
def test_has_a_page_with_its_figure(name: str) -> None:
    page = page_of(name).read_text(encoding="utf-8")
    assert EFFECTS[name].title in page
    assert f"figures/{name}.svg" in page


@pytest.mark.parametrize("name", EFFECTS)
def test_has_tests_of_its_own(name: str) -> None:
    assert "def test_" in next((ROOT / "tests" / "sim" / "effects").glob(f"*/test_{name}.py")).read_text(
        encoding="utf-8"
    )


def test_every_file_that_declares_an_effect_is_registered() -> None:
    files = (ROOT / "sim" / "effects" / "library").glob("*/*.py")
    declared = {file.stem for file in files if "\nEFFECT = " in file.read_text(encoding="utf-8")}
    assert declared == set(EFFECTS)


def test_every_page_is_that_of_an_effect() -> None:
    pages = {page.stem for page in FOLDER.glob("*.md")}
    assert pages == set(EFFECTS)


@pytest.mark.parametrize("file", files(EFFECTS), ids=lambda file: file.stem)
def test_page_is_up_to_date(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    stale = "stale: run python -m docs.generate.effect_pages"
    assert filled(text, files(EFFECTS)[file]) == text, stale


@pytest.mark.parametrize("name", EFFECTS)
def test_page_has_all_sections_and_a_law(name: str) -> None:
    text = page_of(name).read_text(encoding="utf-8")
    assert re.findall(r"^## (.+)$", text, re.M) == ["Law", "Genes", "What it looks like", "Power", "Source"]
    law = text.partition("## Law\n")[2].partition("## Genes")[0]
    assert "<!-- law -->\n" in law, "the law of the declaration stands in the section Law"


@pytest.mark.parametrize("file", [INDEX, *(page_of(name) for name in EFFECTS)], ids=lambda file: file.stem)
def test_links_lead_somewhere(file: Path) -> None:
    targets = LINK.findall(file.read_text(encoding="utf-8"))
    assert targets
    assert [target for target in targets if not (file.parent / target).exists()] == []


@pytest.mark.parametrize("name", EFFECTS)
def test_figure_is_a_drawing_with_units_on_its_axes(name: str) -> None:
    root = ElementTree.parse(FOLDER / "figures" / f"{name}.svg").getroot()  # noqa: S314
    texts = [node.text or "" for node in root.iter() if node.tag.endswith("text")]
    assert any(re.search(r", m[mN]$", text) for text in texts)
    curves = [node.attrib["d"] for node in root.iter() if node.tag.endswith("path")]
    assert curves
    assert not any("nan" in curve for curve in curves)
