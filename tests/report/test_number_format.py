"""Numbers, units and marks at their edges."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.report.findings import BOTH, wing_finding
from wingfit.diagnosis.finding import Interval
from wingfit.report import html
from wingfit.report.location import _pieces, place
from wingfit.report.markup import Markup, tag
from wingfit.report.number_format import Scale, best_of, bounds, listed, number, percent, scale_for, shortened
from wingfit.report.svg import Axis, axis, level, side


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (0.0, "0"),
        (-0.0, "0"),
        (12.0, "12"),
        (1013.25, "1013"),
        (0.8349, "0.835"),
        (-0.0017, "−0.0017"),
        (9.9996, "10"),
        (123456.0, "1.23e5"),
        (4.2e-7, "4.2e−7"),
    ],
)
def test_numbers(value: float, said: str) -> None:
    assert number(value) == said


@pytest.mark.parametrize(
    ("part", "said"),
    [
        (0.0, "0 %"),
        (1.0, "100 %"),
        (0.9999, "> 99.9 %"),
        (1e-5, "< 0.1 %"),
        (0.964, "96.4 %"),
        (0.404, "40 %"),
        (-0.11, "−11 %"),
        (1.2, "120 %"),
    ],
)
def test_percentages_never_claim_certainty(part: float, said: str) -> None:
    assert percent(part).replace("\u00a0", " ") == said


@pytest.mark.parametrize(
    ("value", "unit", "said"),
    [
        (0.0123, "m", "12.3 mm"),
        (5.04e6, "Pa", "5.04 MPa"),
        (0.5, "rad", "28.6°"),
        (0.002, "kg", "2 g"),
        (2e-5, "kg", "20 mg"),
        (2.3, "1", "2.3"),
        (0.4, "N m s/rad", "0.4 N m s/rad"),
        (0.0, "m", "0 m"),
    ],
)
def test_units(value: float, unit: str, said: str) -> None:
    assert scale_for((value, None), unit).text(value).replace("\u00a0", " ") == said


def test_intervals_without_an_end() -> None:
    scale = Scale(1.0, "")
    assert bounds(Interval(2, 1, 3), scale) == "1 to 3"
    assert bounds(Interval(2, None, 3), scale) == "below 3"
    assert bounds(Interval(2, 1, None), scale) == "above 1"
    assert bounds(Interval(2, None, None), scale) == "not bounded by the data"


def test_lists_and_long_names() -> None:
    assert [listed("abc"[:n], "or") for n in range(4)] == ["", "a", "a or b", "a, b or c"]
    assert shortened("abcdefghijkl", 9) == "abcde…jkl"
    assert shortened("abc", 3) == "abc"


def test_phases_go_round() -> None:
    assert _pieces(Interval(0.02, 0.93, 1.11), turns=True) == [(0.0, pytest.approx(0.11)), (0.93, 1.0)]
    assert _pieces(Interval(0.02, -0.07, 0.11), turns=True) == [(0.0, pytest.approx(0.11)), (pytest.approx(0.93), 1.0)]
    assert _pieces(Interval(0.5, 0.2, 1.0), turns=True) == [(0.2, 1.0)]
    assert _pieces(Interval(0.5, -0.2, 0.9), turns=True) == [(0.0, 1.0)]
    assert _pieces(Interval(0.9, 0.8, 1.1), turns=False) == [(0.8, 1.0)]


def test_axes() -> None:
    assert axis([0.0, 10.0], 0, 100, zero=True).at(0.0) == 0
    assert axis([], 0, 1).at(0.0) == 0.5
    log = Axis(0.1, 1000, 0, 400, logarithmic=True)
    assert log.at(1.0) == pytest.approx(100)
    assert log.at(0.0) == 0
    assert log.ticks() == [0.1, 1.0, 10.0, 100.0, 1000.0]
    assert Axis(-1.2, 2.3, 0, 1).ticks(4) == [-1.0, 0.0, 1.0, 2.0]


def test_colour_levels() -> None:
    assert [level(v, 12.0) for v in (0.0, 0.99, 1.0, 11.9, 12.0, 99.0)] == [0, 0, 1, 11, 11, 11]
    assert [side(v, 1.0) for v in (-2.0, -1.0, 0.0, 0.05, 1.0)] == [0, 0, 6, 6, 12]
    assert level(1.0, 0.0) == 0
    assert side(1.0, 0.0) == 6


def test_markup_escapes_all_that_is_not_markup() -> None:
    assert (
        tag("p", "<b>", Markup("<i>x</i>"), title='"&', class_=None) == '<p title="&quot;&amp;">&lt;b&gt;<i>x</i></p>'
    )
    assert tag("line", x1=1.234567, stroke_width=2) == '<line x1="1.23" stroke-width="2"/>'


def test_of_an_ambiguous_verdict_the_one_that_was_put_in_is_credited() -> None:
    """And not what is named together: that is "or", and a hypothesis that has both is another one."""
    finding = replace(
        wing_finding(),
        verdict="ambiguous",
        named=BOTH,
        added_effects=BOTH[:1],
        indistinguishable=tuple((name,) for name in BOTH),
    )
    best = best_of(finding)
    assert best is not None
    assert best.effects == BOTH[:1]
    assert html(finding).count('<li class="named">') == 2


def test_a_place_without_an_interval_has_none() -> None:
    finding = wing_finding()
    assert finding.where is not None
    bare = replace(finding, where=replace(finding.where, span=Interval(0.7, None, None)))
    assert "not bounded" not in str(place(bare))
    assert "span: 70" in str(place(bare))
