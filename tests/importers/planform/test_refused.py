"""What is refused: bad outlines, missing and contradicting statements; each with a remedy."""

from __future__ import annotations

import builtins
import math
from pathlib import Path
from typing import Any

import pytest

from tests.importers.planform.outlines import described, path, polygon, refused, svg, table
from wingfit.importers.planform import dxf, wing_template
from wingfit.records import DatasetError

SQUARE = ((0, 0), (60, 0), (60, 20), (0, 20))


def test_everything_that_is_not_stated_is_listed_at_once(tmp_path: Path) -> None:
    (tmp_path / "wing.svg").write_text(svg(polygon(*SQUARE), attributes='width="6in" height="4in" viewBox="0 0 60 40"'))
    with pytest.raises(DatasetError) as caught:
        wing_template(tmp_path / "wing.svg")
    message = str(caught.value)
    assert caught.value.count == 4
    for words in (
        "--root (left",
        "--leading-edge (left",
        "--hinge-mm",
        "--unit mm",
        "--span-mm",
        "2.54 mm",
        "--unit page",
    ):
        assert words in message


@pytest.mark.parametrize(
    ("drawing", "words"),
    [
        (path("M0 0L60 20L60 0L0 20Z"), "crosses itself near x = 30, y = 10"),
        (path("M0 0L60 0L60 20L20 20L20 -5L10 -5L10 20L0 20Z"), "crosses itself"),
        (path("M0 0L60 0L60 20L0 20"), "are 20 apart; close it"),
        (path("M0 0L60 0L0 0Z"), "has 2 different points"),
        (path("M0 0L60 0L60 .001L0 .001Z"), "a line, not an outline"),
        (polygon(*SQUARE) * 2, "has 2 closed lines: polygon-1 (60 x 20), polygon-2 (60 x 20); say which"),
        (path("M0 0L60 0") + path("M0 5L60 5", "b"), "2 lines, none of them closed"),
        (path("M0 0L60 0L60 20L0 20Z M5 5L20 5L20 15Z"), "wing.1 (60 x 20), wing.2"),
        ("", "no line that can be an outline"),
        ("<use href='#wing'/>", "not read: use"),
        (path("M0 0L60 0L6O 20Z"), "'O 20Z' where a number of the command L"),
        (path("L0 0Z"), "a path starts with M"),
        (path("M0 0L1e999 0L60 20Z"), "numbers up to 1e+09 are read"),
        (path("M0 0L60 0L60 20Z", more='transform="spin(3)"'), "has the transform 'spin(3)'"),
        ("<rect width='60' height='20' rx='3'/>", "round corners"),
        ("<rect width='60%' height='20'/>", "no number of user units"),
        ("<polygon points='0,0 60,0 60'/>", "odd number"),
        (polygon(*((x / 1e6, y / 1e6) for x, y in SQUARE)), "is 6e-08 m long; it must lie in [0.0005, 5] m"),
        (polygon(*((x * 1e3, y) for x, y in SQUARE)), "check the scale"),
    ],
)
def test_bad_drawings(tmp_path: Path, drawing: str, words: str) -> None:
    assert words in refused(tmp_path, svg(drawing))


def test_gaps_are_filled_if_the_user_says_so(tmp_path: Path) -> None:
    slotted = svg(path("M0 0L60 0L60 9L30 9L30 11L60 11L60 20L0 20Z"))
    assert "gaps or overhangs of 5.3 %" in refused(tmp_path, slotted)
    found = described(tmp_path, slotted, fill_gaps=True)
    assert math.isclose(found.measures.area_m2, 60 * 20e-6, rel_tol=1e-9)
    assert any("count as wing" in remark for remark in found.remarks)


def test_the_outline_is_chosen_by_name_and_open_lines_are_mentioned(tmp_path: Path) -> None:
    drawing = svg(polygon(*SQUARE), path("M0 0L90 0L90 30L0 30Z", "big"), path("M0 5L9 5", "rod"))
    found = described(tmp_path, drawing, outline="big")
    assert math.isclose(found.measures.span_m, 0.09)
    assert "did you mean 'big'" in refused(tmp_path, drawing, outline="bigg")
    (remark,) = described(tmp_path, svg(polygon(*SQUARE), path("M0 5L9 5", "rod"))).remarks
    assert remark == "open lines, not read: rod"


def test_hidden_shapes_and_definitions_are_no_outlines(tmp_path: Path) -> None:
    hidden = "".join(f"<{tag}>{polygon(*SQUARE)}</{tag}>" for tag in ("defs", "clipPath", "symbol"))
    hidden += f'<g style="display:none">{polygon(*SQUARE)}</g><g display="none">{polygon(*SQUARE)}</g>'
    assert math.isclose(described(tmp_path, svg(hidden, polygon(*SQUARE))).measures.span_m, 0.06)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"root": "left", "leading_edge": "right"}, "at right angles"),
        ({"root": "lft"}, "did you mean 'left'"),
        ({"unit": "page"}, "states no size of its page"),
        ({"unit": "mm", "span_mm": 60.0}, "states the scale, as --unit does"),
        ({"hinge_mm": math.nan}, "--hinge-mm"),
        ({"hinge_mm": 9000.0}, "it must lie in [-5000, 5000] mm"),
        ({"accuracy": 0.5}, "--accuracy"),
        ({"thickness_mm": (0.0, 1.0)}, "--thickness-mm"),
        ({"marker_grid": (0, 4)}, "--marker-grid: is 0x4; it must be two numbers"),
        ({"accuracy": 0.0}, "--accuracy: is 0; it must lie in [1e-05, 0.05]"),
        ({"marker_grid": (2, 4), "marker_file": "m.csv"}, "give one of them"),
        ({"origin": (math.inf, 0.0)}, "--origin"),
        ({"marker_file": "none.csv"}, "none.csv cannot be read"),
    ],
)
def test_bad_statements(tmp_path: Path, options: dict[str, Any], words: str) -> None:
    assert words in refused(tmp_path, svg(polygon(*SQUARE)), **options)


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        ("0,0\n60,0\n60,nan\n0,20\n", {}, "line 3, column 'y': is empty"),
        ("0,0\n60,0\n6o,20\n0,20\n", {}, "line 3, column 'x': is '6o'; it must be a number"),
        ("0,0\n60,0\n", {}, "has 2 points"),
        ("1,0,0\n2,60,0\n", {}, "has 3 numbers"),
        ("", {}, "is empty"),
        ("chord,span\n1,2\n", {}, "how the wing is swept"),
        ("x_mm,y_cm\n1,2\n", {}, "write all in one unit"),
        ("span,le,cm\n1,2,3\n", {}, "stations need"),
        (table(*SQUARE), {"root": "left", "leading_edge": "top"}, "does not say where y points"),
        (table(*SQUARE, header="x_mm,y_mm"), {"unit": "cm"}, "but the file states mm"),
        ("span,le,te\n0,0,9\n50,0,9\n40,0,9\n", {}, "span 40 follows 50"),
        ("span,le,te\n0,0,9\n50,9,0\n90,0,9\n", {}, "change places"),
        ("span,le,chord\n0,0,9\n50,9,-2\n", {}, "a chord must be above 0"),
        ("span,le,te\n0,0,9\n50,0,9\n", {"root": "low-x", "leading_edge": None}, "low-y or high-y"),
        ("span,le,te\n0,0,9\n50,0,9\n", {"root": "low-y", "leading_edge": "high-x"}, "leave it out"),
    ],
)
def test_bad_tables(tmp_path: Path, text: str, options: dict[str, Any], words: str) -> None:
    assert words in refused(tmp_path, text, "wing.csv", **options)


def test_other_files(tmp_path: Path) -> None:
    assert "not valid XML" in refused(tmp_path, "<svg><path></svg>")
    assert "not SVG" in refused(tmp_path, "<html/>")
    assert "entities" in refused(tmp_path, '<!DOCTYPE svg [<!ENTITY a "b">]><svg/>')
    assert "no drawing (SVG, DXF) and no table" in refused(tmp_path, bytes(range(256)) * 9)
    with pytest.raises(DatasetError, match="cannot be read"):
        wing_template(tmp_path / "gone.svg")
    with pytest.raises(DatasetError, match="is a folder"):
        wing_template(tmp_path)


def test_a_dxf_without_the_library_says_how_to_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usual = builtins.__import__

    def missing(name: str, *rest: Any, **more: Any) -> Any:
        if name.startswith("ezdxf"):
            raise ImportError(name)
        return usual(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", missing)
    message = refused(tmp_path, "0\nSECTION\n2\nENTITIES\n0\nENDSEC\n0\nEOF\n", "wing.dxf")
    assert "wingfit[dxf]" in message
    assert "SVG" in message
    assert dxf.read_dxf.__doc__
