"""What the figures of wingfit.plot show, read from their data."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wingfit
from tests.plot.samples import HISTORY, forces, gene, series, tracks
from tests.report.findings import force_finding, wing_finding, with_verdict
from wingfit import plot
from wingfit.calibration.forces.result import LocalEstimate
from wingfit.plot import style, themes
from wingfit.report import finding_json

ROOT = Path(__file__).parents[2]
Z95, Z90 = 1.959964, 1.644854


def trace(figure: Any, name: str, nth: int = 0) -> Any:
    return [one for one in figure.data if one.name == name][nth]


def test_the_colours_are_those_of_the_page_and_of_the_report() -> None:
    page = (ROOT / "service" / "web" / "style.css").read_text().partition("color-scheme: dark")[0]
    report = (ROOT / "report" / "templates" / "style.css").read_text()
    for k, colour in enumerate(style.SERIES, 1):
        assert f"--series-{k}: {colour};" in page
    for name, colour in (("ink", style.INK), ("quiet", style.QUIET), ("faint", style.FAINT), ("line", style.LINE)):
        assert f"--{name}: {colour};" in page
    assert f"--before:{style.BEFORE};--after:{style.AFTER};" in report


def test_dark_figures_have_the_dark_colours_of_the_page_and_of_the_report() -> None:
    page = (ROOT / "service" / "web" / "style.css").read_text().partition("color-scheme: dark")[2].partition("* {")[0]
    report = (ROOT / "report" / "templates" / "style.css").read_text()
    for k, colour in enumerate(themes.SERIES, 1):
        assert f"--series-{k}: {colour};" in page
    for name, colour in (("ink", themes.INK), ("quiet", themes.QUIET), ("faint", themes.FAINT), ("line", themes.LINE)):
        assert f"--{name}: {colour};" in page
    assert f"--ground: {themes.GROUND};" in page
    assert f"--before:{themes.BEFORE};--after:{themes.AFTER};" in report
    for light in (plot.history(HISTORY), plot.wing(tracks()), plot.forces(forces()), plot.ranking(wing_finding())):
        found = plot.dark(light)
        assert light.layout.paper_bgcolor == style.GROUND, "the figure itself stays light"
        assert [len(found.data), len(found.frames)] == [len(light.data), len(light.frames)]
        assert found.layout.paper_bgcolor == themes.GROUND
        drawn = {"data": found.to_plotly_json()["data"], "layout": {**found.to_plotly_json()["layout"], "template": 0}}
        assert not [colour for colour in themes.DARK if f"'{colour}'" in str(drawn)], "none is left"


def test_the_history_has_a_gap_between_stages_and_no_mean_of_one_individual() -> None:
    figure = plot.history(HISTORY)
    best, mean = trace(figure, "best"), trace(figure, "mean")
    assert list(best.x) == [1, 2, None, 3, None, 4]
    assert list(best.y) == [4.0, 1.0, None, 0.25, None, 0.04]
    assert list(mean.y) == [9.0, 2.0, None, 0.5, None, None]
    assert "2.00 mm per marker" in figure.layout.title.text
    assert figure.layout.yaxis.title.text == "fitness, m²"
    assert [one.text for one in figure.layout.annotations] == [
        "structural", "aerodynamic", "aerodynamic, Gauss-Newton",
    ]  # fmt: skip
    with pytest.raises(ValueError, match="no generation yet"):
        plot.history([])


def test_a_fitness_of_series_is_shown_in_percent_of_the_range() -> None:
    figure = plot.history([HISTORY[0] | {"best_mm": None, "best_percent": 3.0}])
    assert trace(figure, "best").y == (3.0,)
    assert trace(figure, "mean").y == (4.5,)  # the root of the ratio of the squares
    assert figure.layout.yaxis.title.text == "fitness, % of range"


def test_recorded_and_simulated_never_hide_each_other() -> None:
    figure = plot.comparison(forces(), channels=["x"])
    recorded, modelled, residual = (
        trace(figure, "recorded"),
        *(trace(figure, "modelled, local coefficients", k) for k in (0, 1)),
    )
    assert (recorded.line.color, recorded.line.dash) != (modelled.line.color, modelled.line.dash)
    assert modelled.line.dash == "dash"
    assert residual.y == pytest.approx([1.0] * 8)  # mN
    assert residual.yaxis != modelled.yaxis
    assert figure.layout.yaxis2.title.text == "residual, mN"
    both = plot.forces(forces()).layout
    assert [both.xaxis2.title.text, both.xaxis4.title.text] == ["", style.PHASE], "below the last pair alone"
    band = [one for one in figure.data if one.fill == "tonexty"]
    assert band[0].y == pytest.approx(np.array(recorded.y) + 10)


def test_tracks_are_compared_in_the_order_of_the_phase_with_gaps() -> None:
    figure = plot.comparison(tracks(), channels=["b_z"])
    recorded, residual = trace(figure, "recorded"), trace(figure, "simulated", 1)
    assert list(recorded.x) == [0.0, 0.25, 0.5, 0.75]
    assert recorded.mode == residual.mode == "markers"
    assert list(np.isnan(recorded.y)) == [False, False, False, True]
    assert list(residual.y)[:3] == pytest.approx([2.0] * 3)


def test_by_default_tracks_show_heights_from_root_to_tip() -> None:
    figure = plot.comparison(tracks())
    titles = [one.text for one in figure.layout.annotations if one.text]
    assert [re.match(r"marker (\w+), (\d+) mm", text).groups() for text in titles] == [("a", "50"), ("b", "400")]  # type: ignore[union-attr]


def test_a_finding_is_compared_before_and_after() -> None:
    finding = wing_finding()
    one = finding.overlays[0]
    figure = plot.comparison(finding, recording=one.recording, channels=[one.channel])
    before, after = trace(figure, "before: nominal model, refitted"), trace(figure, "after: with the named effects")
    assert (before.line.color, before.line.dash) == (style.BEFORE, "dash")
    assert after.line.color == style.AFTER
    assert before.y == pytest.approx([1e3 * value for value in one.before])
    again = plot.comparison(finding_json(finding), recording=one.recording, channels=[one.channel])
    assert again == figure


def test_series_are_compared_over_time() -> None:
    figure = plot.comparison(series())
    assert trace(figure, "best genome", 1).y == pytest.approx([0.0, 0.25, 0.0])
    assert {one.name for one in figure.data} == {"recorded", "best genome"}
    assert figure.layout.xaxis2.title.text == "time, s"


def test_no_line_crosses_a_gap_in_a_series() -> None:
    source = series()
    times = [0.0, 0.1, 0.2, 5.0, 5.1, 5.2]
    source["curves"][0] |= {"time_s": times, "recorded": [1.0] * 6, "best": [2.0] * 6}
    best = trace(plot.comparison(source), "best genome", 0)
    assert list(best.x) == pytest.approx([0.0, 0.1, 0.2, 2.6, 5.0, 5.1, 5.2])
    assert [k for k, value in enumerate(best.y) if np.isnan(value)] == [3]


def test_the_residual_of_a_wing_is_a_map_before_and_after_on_one_scale() -> None:
    finding = wing_finding()
    figure = plot.residual(finding)
    assert finding.phase_map is not None
    before, after = figure.data
    assert np.array(before.z) == pytest.approx(1e3 * np.array(finding.phase_map.before))
    assert (before.coloraxis, after.coloraxis) == ("coloraxis", "coloraxis")
    assert figure.layout.coloraxis.cmax == pytest.approx(1e3 * max(map(max, finding.phase_map.before)))
    assert f"noise alone gives {1e3 * finding.phase_map.noise:.3g} mm" in figure.layout.title.text


def test_the_residual_of_forces_is_a_curve_with_the_noise() -> None:
    finding = force_finding()
    figure = plot.residual(finding)
    assert finding.phase_map is not None
    before = trace(figure, "before: nominal model, refitted")
    assert before.y == pytest.approx([1e3 * value for value in finding.phase_map.before[0]])
    assert figure.layout.shapes[0].y0 == pytest.approx(1e3 * finding.phase_map.noise)


def test_the_residual_of_tracks_is_a_distance() -> None:
    figure = plot.residual(tracks(gap=3.0))
    assert trace(figure, "mean of the markers").y == pytest.approx([3.0] * 4)
    assert trace(figure, "largest").y == pytest.approx([3.0] * 4)


def test_forces_without_a_recording() -> None:
    beat = {"phase": [0.0, 0.5], "lift_n": [2.0, -1.0], "thrust_n": [0.5, 0.5]}
    figure = plot.forces({"recording": "slow", "outputs": beat})
    assert (trace(figure, "lift").y, figure.layout.yaxis.title.text) == (pytest.approx([2.0, -1.0]), "N")
    assert trace(figure, "lift").line.dash != trace(figure, "thrust").line.dash
    assert [one.name for one in plot.forces(beat, ["thrust"]).data] == ["thrust"]
    with pytest.raises(ValueError, match="no forces drag; there are lift, thrust"):
        plot.forces(beat, ["drag"])
    with pytest.raises(TypeError, match=r"give Client\.forces"):
        plot.forces({"phase": [0.0]})


def test_the_wing_shows_the_difference_magnified() -> None:
    figure = plot.wing(tracks(), phase=0.02, magnify=10)
    lines = trace(figure, "difference × 10")
    assert list(lines.z)[:2] == pytest.approx([0.0, 20.0])  # 2 mm
    assert list(lines.z)[3:5] == pytest.approx([0.0, 20.0])
    assert "slow &lt;1&gt; at phase 0.00: mean distance 2.00 mm" in figure.layout.title.text
    assert trace(figure, "recorded").text[1] == "b: 2.00 mm apart"
    moving = plot.wing(tracks())
    assert [frame.name for frame in moving.frames] == ["0.00", "0.25", "0.50", "0.75"]
    assert any(one.name == "difference × 5" for one in moving.data)  # 10 mm of 350 mm
    for wrong, words in ((1.5, "must lie in"), (-0.1, "must lie in")):
        with pytest.raises(ValueError, match=words):
            plot.wing(tracks(), phase=wrong)
    with pytest.raises(TypeError, match="no marker positions"):
        plot.wing(forces())


def test_the_ranking_has_probability_evidence_explained_and_predicted() -> None:
    finding = wing_finding()
    figure = plot.ranking(finding)
    chances, explained = figure.data[:2]
    first = finding.hypotheses[0]
    assert chances.x[0] == pytest.approx(100 * first.probability)
    assert f"ln evidence {first.evidence:.1f}" in chances.text[0]
    assert explained.x[0] == pytest.approx(100 * first.explained)
    assert chances.marker.color[0] == style.ACCENT
    assert list(explained.marker.opacity) == [
        1.0 if h.refitted or not h.effects else 0.4 for h in finding.hypotheses[: len(chances.x)]
    ]
    assert "nominal model alone" in chances.y
    assert plot.ranking(with_verdict(finding, "adequate")).layout.title.text == "Hypotheses: verdict adequate"


def test_intervals_are_95_percent_of_the_standard_errors() -> None:
    result = {"kind": "tracks", "genes": [gene("E_f", 2.0, 0.5), gene("fixed", 1.0, None, searched=False)]}
    figure = plot.intervals(result)
    bounds, interval, best, nominal = figure.data
    assert list(bounds.x) == [0.1, 10.0]
    assert list(interval.x) == pytest.approx([2 - 0.5 * Z95, 2 + 0.5 * Z95])
    assert (best.x, nominal.x) == ((2.0,), (1.0,))
    assert figure.layout.xaxis.type == "log"  # bounds that differ by a factor of 100
    assert figure.layout.title.text == "Estimates with 95 % intervals"
    assert list(plot.intervals(result, 0.9).data[1].x) == pytest.approx([2 - 0.5 * Z90, 2 + 0.5 * Z90])


def test_a_gene_that_the_recordings_do_not_bound_has_an_open_interval() -> None:
    figure = plot.intervals({"genes": [gene("G_f", 10.0, None, identifiable=False)]})
    interval = figure.data[1]
    assert list(interval.x) == pytest.approx([10**end for end in figure.layout.xaxis.range])
    running: Any = gene("G_f", 5.0, None) | {"identifiable": None}
    assert len(plot.intervals({"genes": [running]}).data) == 3  # no interval yet


def test_intervals_of_a_finding_are_those_that_it_states() -> None:
    finding = wing_finding()
    figure = plot.intervals(finding)
    assert figure.layout.title.text == "Estimates with 90 % intervals"
    titles = [one.text for one in figure.layout.annotations]
    first = next(g for g in finding.genes if g.off is not None or "." in g.name)
    assert titles[0].startswith(first.name)


def test_intervals_of_the_library_and_of_the_server_agree() -> None:
    one = LocalEstimate("a", ("a",), {"C_l": 1.5}, {"C_l": 0.1}, ((1.0,),), (), 0.0, converged=True, remarks=())
    here = wingfit.ForceResult((), (one,), None, (), (), (), 0.0, 0.0, None, None)
    coefficient = {"name": "C_l", "value": 1.5, "standard_error": 0.1}
    there = {"genes": [], "estimates": [{"name": "a", "coefficients": [coefficient]}]}
    assert plot.intervals(here) == plot.intervals(there)
    assert list(plot.intervals(here).data[0].x) == pytest.approx([1.5 - 0.1 * Z95, 1.5 + 0.1 * Z95])


def test_conditions_show_what_differs_and_what_is_held_out() -> None:
    dataset = wingfit.load_dataset(ROOT / "examples" / "delfly")
    figure = plot.conditions(dataset)
    axes = [figure.layout[f"xaxis{k or ''}"].title.text for k in ("", 2, 3)]
    assert axes == ["flap frequency, Hz", "airspeed, m/s", "body pitch, deg"]
    held_out = trace(figure, "held out")
    assert set(held_out.y) == set(dataset.held_out)
    assert held_out.marker.color == style.GROUND
    assert "pressure 1013 mbar" in figure.layout.title.text
    swings = plot.conditions(wingfit.load_dataset(ROOT / "examples" / "pendulum"))
    assert swings.layout.xaxis.title.text == "duration, s"


@pytest.mark.parametrize("draw", [plot.comparison, plot.residual, plot.ranking, plot.intervals, plot.conditions])
def test_what_cannot_be_drawn_is_refused_with_what_can(draw: Any) -> None:
    for wrong in ({"status": "ok"}, 3):
        with pytest.raises(TypeError, match="give "):
            draw(wrong)


def test_unknown_names_are_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"recording 'fast'; there are those of test-1"):
        plot.comparison(forces(), recording="fast")
    with pytest.raises(ValueError, match="curves of lift; there are x, z"):
        plot.comparison(forces(), channels=["lift"])
    with pytest.raises(ValueError, match=r"level is 95; it must lie in \(0, 1\)"):
        plot.intervals(series(), level=95)
