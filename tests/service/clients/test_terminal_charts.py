"""Charts in the terminal: what they draw, in Braille and in ASCII, without a server."""

from __future__ import annotations

import math

import pytest

from wingfit.cli.charts.chart import BRAILLE, Chart, Line, drawn, show_chart

X = [k / 20 for k in range(21)]
RAMP = Line("ramp", X, X)
FLAT = Line("flat", X, [0.5] * 21)


def text(chart: Chart, width: int = 60, height: int = 12, *, braille: bool = False) -> list[str]:
    return [line.plain for line in drawn(chart, width, height, braille=braille)]


def test_a_curve_runs_from_corner_to_corner_with_its_ends_on_the_axes() -> None:
    lines = text(Chart("a ramp", "time, s", "rad", [RAMP]))
    assert lines[:2] == ["a ramp", "rad"]
    body = lines[2:14]
    heights = [
        min(k for k, line in enumerate(body) if column < len(line) and line[column] == "*") for column in (7, 30, 55)
    ]
    assert heights[0] > heights[1] > heights[2]
    assert any(line.startswith("0.5 +") for line in body)
    assert lines[-2].split() == ["0", "time,", "s", "1"]
    assert lines[-1] == "* ramp"


@pytest.mark.parametrize("braille", [True, False])
@pytest.mark.parametrize(("width", "height"), [(40, 8), (80, 16), (200, 24)])
def test_a_chart_keeps_the_size_of_the_terminal(width: int, height: int, braille: bool) -> None:
    lines = text(Chart("t" * 300, "x", "y", [RAMP, FLAT], zero=True, breaks=[0.3]), width, height, braille=braille)
    assert max(map(len, lines)) <= width
    assert len(lines) == height + 5


def test_plain_charts_are_ascii() -> None:
    chart = Chart("fläche × 2", "phase", "m²", [RAMP, Line("größte", X, [1 - x for x in X])], breaks=[0.5], zero=True)
    plain, braille = "\n".join(text(chart)), "\n".join(text(chart, braille=True))
    assert plain.isascii()
    assert "m^2" in plain
    assert any(BRAILLE < ord(one) < BRAILLE + 256 for one in braille)
    assert ":" in plain


def test_two_equal_curves_are_both_seen() -> None:
    """Neither hides the other: in ASCII they alternate, in Braille the second is dashed."""
    body = "".join(text(Chart("", "x", "", [FLAT, Line("the same", X, FLAT.y)]))[1:13])
    assert abs(body.count("*") - body.count("o")) <= 1
    below = Line("below", X, [0.0] * 21)
    for lines, dashed in (([below, FLAT], 0), ([FLAT, below], 1)):
        rows = text(Chart("", "x", "", lines), braille=True)[1:13]
        marks = [count for row in rows if (count := sum(ord(one) > BRAILLE for one in row))]
        assert len(marks) == 2
        assert marks[dashed] < 0.7 * marks[1 - dashed], "upper curve first"


def test_gaps_and_values_that_have_no_logarithm_are_left_out() -> None:
    gap = Line("gap", X, [None if 5 < k < 15 else math.nan if k == 15 else 1.0 for k in range(21)])
    (row,) = (line for line in text(Chart("", "x", "", [gap])) if "*" in line and "gap" not in line)
    assert "*    " in row
    logs = Chart("", "generation", "fitness", [Line("best", [1, 2, 3], [100.0, 0.0, 1.0])], logarithmic=True)
    assert {line.split("+")[0].strip() for line in text(logs) if "+" in line[:8]} >= {"1", "10", "100"}
    assert text(Chart("nothing", "x", "", [Line("none", X, [None] * 21)])) == ["nothing", "no values to draw"]


def test_constant_values_have_an_axis() -> None:
    for value in (0.0, 5.0, -3.0):
        one = text(Chart("", "x", "", [Line("constant", [1.0], [value])]))
        assert sum("*" in line for line in one[:-1]) == 1


def test_an_output_that_is_no_terminal_gets_ascii_and_no_control_characters(capsys: pytest.CaptureFixture[str]) -> None:
    show_chart(Chart("name \x1b[31m of a dataset", "phase", "mm", [RAMP]))
    shown = capsys.readouterr().out
    assert shown.isascii()
    assert "\x1b" not in shown
    assert max(map(len, shown.splitlines())) <= 80
