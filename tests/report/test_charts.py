"""Pages of line charts: gaps, bands, logarithmic axes, nothing to load."""

from __future__ import annotations

import re

import numpy as np

from tests.report.pages import LOADS, Page
from wingfit.report.charts import DECADES, Chart, Curve, chart_page

X = [0.0, 0.25, 0.5, 0.75, 1.0]


def drawn(*charts: Chart) -> Page:
    return Page(chart_page("Loads of <a wing>", charts))


def test_a_page_needs_no_script_and_names_every_curve() -> None:
    curves = [Curve(f"motor {k}", X, [float(k * v) for v in range(5)]) for k in range(8)]
    page = drawn(Chart("Torque", "phase", "N m", curves))
    assert not {tag for tag, _ in page.tags} & {"script", "link", "img"}
    assert not any(set(attributes) & LOADS for _, attributes in page.tags)
    assert "Loads of <a wing>" in page.texts
    assert all(f"motor {k}" in page.texts for k in range(8))
    assert [page.count("path", f"s{k}") for k in range(6)] == [2, 2, 1, 1, 1, 1], "colours are used again after six"


def test_a_gap_in_the_data_is_a_gap_in_the_curve() -> None:
    page = drawn(Chart("Force", "s", "N", [Curve("force", np.array(X), np.array([1.0, 2.0, np.nan, 2.0, 1.0]))]))
    assert page.count("path", "s0") == 2
    assert "nan" not in page.source


def test_bands_and_samples_have_no_colour_of_a_curve() -> None:
    ones, twos = [1.0] * 5, [2.0] * 5
    curves = [Curve("2 standard errors", X, ones, band=(ones, twos)), Curve("measured", X, ones, dots=True)]
    page = drawn(Chart("Angle", "t*", "deg", [*curves, Curve("series", X, ones)]))
    assert (page.count("path", "band"), page.count("path", "s0")) == (1, 1)
    assert page.count("path", "points") == 2, "one in the legend"


def test_a_logarithmic_axis_omits_rounding_errors() -> None:
    page = drawn(Chart("Spectrum", "Hz", "N²/Hz", [Curve("force", X, [1.0, 1e-3, 1e-9, 1e-30, 0.0])], logarithmic=True))
    ticks = [float(text.replace("\u2212", "-")) for text in page.texts if re.fullmatch(r"1e\u2212\d+|0\.0*1|1", text)]
    assert min(ticks) == 10.0**-DECADES


def test_charts_without_values_are_omitted() -> None:
    page = drawn(Chart("Nothing", "s", "N", [Curve("force", [], [])]))
    assert "svg" not in {tag for tag, _ in page.tags}
