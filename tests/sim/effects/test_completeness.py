"""Nothing is registered without a page, a figure and tests of its own; and no file is left unregistered."""

from __future__ import annotations

from pathlib import Path

import pytest

from wingfit.sim.effects.registry import EFFECTS

ROOT = Path(__file__).parents[3]
PAGES = ROOT / "docs" / "effects"


@pytest.mark.parametrize("name", EFFECTS)
def test_has_a_page_with_its_figure(name: str) -> None:
    page = (PAGES / f"{name}.md").read_text(encoding="utf-8")
    assert EFFECTS[name].title in page
    assert f"figures/{name}.svg" in page
    assert (PAGES / "figures" / f"{name}.svg").read_text(encoding="utf-8").startswith(("<?xml", "<svg"))


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
    pages = {page.stem for page in PAGES.glob("*.md")} - {"index", "README"}
    assert pages == set(EFFECTS)
