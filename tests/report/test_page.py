"""The page needs nothing else, escapes everything, survives every finding, and shows the numbers that it was given."""

from __future__ import annotations

import dataclasses
import math
import re
from dataclasses import replace
from typing import Any

import pytest

from tests.report.findings import around, bare, force_finding, load, recording, times, wing_finding, with_verdict
from tests.report.pages import LOADS, page
from wingfit.diagnosis.advice.advised import Advice, AdvisedCost, AdvisedPlace
from wingfit.diagnosis.finding import VERDICTS, Finding, Interval, MarkerMisfit, Verdict
from wingfit.report import html

HOSTILE = "</style></title><script>alert(1)</script><img src=x onerror=alert(1)>\"' & \x00\ud800"


def poisoned(value: Any) -> Any:
    """The same with every text hostile, but for the words of fixed sets."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        kept = {"kind", "unit", "verdict"} if isinstance(value, Finding) else set()
        names = [f.name for f in dataclasses.fields(value) if f.name not in kept]
        return replace(value, **{name: poisoned(getattr(value, name)) for name in names})
    if isinstance(value, tuple):
        return tuple(poisoned(item) for item in value)
    if isinstance(value, dict):
        return {HOSTILE + key: poisoned(item) for key, item in value.items()}
    return HOSTILE + value if isinstance(value, str) else value


def variants() -> dict[str, Finding]:
    wing, forces = wing_finding(), force_finding()
    long = "a-name-" * 30
    both = {f"{kind}, {v}": with_verdict(f, v) for kind, f in (("wing", wing), ("forces", forces)) for v in VERDICTS}
    empty = {f"bare, {v}": replace(bare(wing), verdict=v) for v in VERDICTS}
    many = tuple(recording(k, held_out=k % 6 == 0) for k in range(72))
    still = tuple(replace(m, before=0.0, after=0.0) for m in wing.markers)
    flat = MarkerMisfit("only", 0.5, 0.5, 0.0, 0.2, 0.001, 0.0, 0.5, (0.0, 0.0, 0.0))
    assert wing.phase_map is not None
    silent = replace(
        wing.phase_map, before=times(wing.phase_map.before, 0), after=times(wing.phase_map.after, 0), noise=0
    )
    return {
        **both,
        **empty,
        "72 recordings": replace(wing, recordings=many, missing=tuple(load(r.name, 30, 90, 1.0) for r in many)),
        "one recording": replace(wing, recordings=(recording(0, held_out=False),), proof=None),
        "long names": replace(
            wing, dataset=long, recordings=tuple(replace(r, name=long) for r in wing.recordings)
        ),
        "nothing beyond noise": replace(wing, markers=still, phase_map=silent, missing=(load("r", 3, 4, 0.0),)),
        "no outline": replace(wing, outline=()),
        "one marker": replace(wing, markers=(flat,), outline=()),
        "zero misfit": replace(
            wing,
            strength=0.0,
            floors=replace(wing.floors, noise=0.0, simulation=0.0, total=0.0, discretisation=None),
            recordings=(replace(recording(0, held_out=True), before=around(0, 0), after=around(0, 0), floor=0.0),),
        ),
        "unbounded": replace(
            wing, recordings=tuple(replace(r, before=Interval(1.0, None, None)) for r in wing.recordings)
        ),
    }  # fmt: skip


VARIANTS = variants()


@pytest.mark.parametrize("name", VARIANTS)
def test_every_finding_makes_a_sound_page_that_loads_nothing(name: str) -> None:
    finding = VARIANTS[name]
    shown = page(finding)
    assert not {tag for tag, _ in shown.tags} & {"script", "link", "img", "iframe", "object", "base", "form", "use"}
    assert not any(
        set(attributes) & LOADS or any(k.startswith("on") for k in attributes) for _, attributes in shown.tags
    )
    assert "//" not in shown.source.replace("<!DOCTYPE", "")
    assert set(re.findall(r"url\(([^)]*)\)|(@import)", shown.source)) <= {("#hatch", ""), ("#guess", "")}
    assert not re.search(r"\b(nan|inf|None)\b", shown.source)
    policy = next(a["content"] for tag, a in shown.tags if tag == "meta" and "http-equiv" in a)
    assert policy == "default-src 'none'; style-src 'unsafe-inline'"
    assert finding.dataset in shown.text
    assert finding.summary in shown.text
    assert len(shown.source) < 1_500_000


@pytest.mark.parametrize("finding", [wing_finding(), force_finding(), with_verdict(wing_finding(), "unnamed")])
def test_no_text_becomes_markup(finding: Finding) -> None:
    clean, dirty = page(finding), page(poisoned(finding))
    assert {tag for tag, _ in dirty.tags} <= {tag for tag, _ in clean.tags}
    assert {k for _, a in dirty.tags for k in a} <= {k for _, a in clean.tags for k in a}
    assert dirty.source.encode("utf-8").count(b"<script") == 0
    assert "\x00" not in dirty.source
    assert "<script>alert(1)</script>" in dirty.text  # it is there, as text


@pytest.mark.parametrize(
    ("verdict", "headline"),
    [
        ("adequate", "The model is adequate: these recordings show no missing physics"),
        ("named", "Missing physics: Displaced hinge + Harmonics of the drive"),
        (
            "ambiguous",
            "Missing physics: Displaced hinge or Harmonics of the drive; these recordings cannot distinguish them",
        ),
        ("unnamed", "Missing physics that no effect of the library explains"),
        ("partly named", "A part of what is missing: Displaced hinge + Harmonics of the drive; more remains"),
        ("measurement fault", "Measurement fault: Rotated camera frame"),
    ],
)
def test_the_verdict_comes_first(verdict: Verdict, headline: str) -> None:
    finding = with_verdict(wing_finding(), verdict)
    shown = page(finding)
    assert f"<h1>{headline}</h1>" in html(finding)
    assert [name for name in VERDICTS if name in shown.texts] == list(VERDICTS)
    assert shown.texts.count("96.4 %") >= 1
    assert shown.texts.count("0.9 %") >= 4


def test_a_doubtful_adequate_model_is_not_headed_as_adequate() -> None:
    finding = with_verdict(wing_finding(), "adequate")
    doubtful = replace(finding, probabilities=finding.probabilities | {"adequate": 0.6, "unnamed": 0.4})
    assert "<h1>The model may be adequate: these recordings show no missing physics, and cannot" in html(doubtful)


def test_what_an_effect_may_explain_is_not_headed_as_unexplained() -> None:
    finding = with_verdict(wing_finding(), "unnamed")
    doubtful = replace(finding, probabilities={"named": 0.7, "unnamed": 0.3})
    assert "<h1>Missing physics; whether an effect of the library explains it is not certain</h1>" in html(doubtful)
    assert "do not explain it" not in html(doubtful)
    assert "which may not be the cause" in html(doubtful)


def test_an_error_that_the_last_refinement_leaves_has_no_finer_model() -> None:
    finding = wing_finding()
    text = page(replace(finding, floors=replace(finding.floors, finer=""))).text
    assert "discretisation error that the last refinement leaves: 0.21" in text
    assert "finer model" not in text


def test_the_numbers_shown_are_those_given() -> None:
    text = page(wing_finding()).text
    for said in (
        "5.12",  # strength
        "0.8 mm",  # noise
        "0.83 mm",  # floor
        "4.43 → 1.04",
        "before: 4.43 (90 %: 4.11 to 4.75)",
        "nominal model, refitted: 4.1",
        "discretisation error, from a finer model: 0.21",
        "The finer model: 48 bodies (12 x 4)",
        "5 (4.6 to 5.4)",  # before, mm, of tunnel-3hz-5
        "span: 85 %, 90 % within 70 to 100 %",
        "phase of the beat: 0.02, 90 % within 0.93 to 1.11",
        "61 %",  # first harmonic
        "flap frequency: 1.9 (2 to 5 Hz)",
        "12.3 mm",
        "11.7 to 12.9 mm",
        "−1.7 to 0.1 mm",
        "0 mm (in the interval)",
        "3.55°",
        "above 3.32°",
        "5.04 MPa",
        "not bounded by the data",
        "97.3 %",
        "96.1 %",
        "−11 %",
        "+409",  # evidence of the first
        "Displaced hinge and Harmonics of the drive",
        "Record at 5 Hz in vacuum, with a lag of 14°.",
        "Source of displaced hinge (1935), Eq. 3",
        "Noise rests on 6 beats only.",
        "6.9 minutes, 18240 evaluations",
        "commit 0123abc",
    ):
        assert said in text, said


def test_forces_are_in_millinewtons_and_need_no_wing() -> None:
    shown = page(force_finding())
    assert "force axis X: 31 mN before, 1.1 mN after" in shown.text
    assert "The missing load is most significant at phase 0.12: 174 ± 89 mN (test-4)" in shown.text
    assert "mm" not in re.findall(r"\b[a-z]+\b", shown.text)
    assert shown.count("path", "outline") == 0


def test_every_marker_is_on_both_maps_in_its_colour() -> None:
    finding = wing_finding()
    shown = page(finding)
    assert shown.count("circle", "marker") == 2 * 49
    most = max(m.before for m in finding.markers)
    expected = [min(11, int(12 * v / most)) for m in finding.markers for v in (m.before, m.after)]
    found = [int(c.split(" l")[1]) for _, a in shown.tags if "marker" in (c := a.get("class") or "").split()]
    assert sorted(found) == sorted(expected)


def test_recordings_held_out_are_apart_and_the_dots_lie_where_they_should() -> None:
    finding = replace(wing_finding(), proof=None)
    shown = page(finding)
    assert "Held out (3)" in shown.texts
    assert "Fitted (6)" in shown.texts
    before = [float(a["cx"] or 0) for tag, a in shown.tags if tag == "circle" and a.get("class") == "dot before"]
    rows = [r for held in (True, False) for r in finding.recordings if r.held_out == held]
    places = before[: len(rows)]
    slopes = [(places[k] - 12) / rows[k].before.value for k in range(len(rows))]  # the axis starts at zero
    assert max(slopes) == pytest.approx(min(slopes), rel=2e-3)


def test_without_held_out_recordings_the_page_says_that_nothing_is_proved() -> None:
    finding = wing_finding()
    fitted = tuple(r for r in finding.recordings if not r.held_out)
    said = "so the improvement is not validated"
    assert f"No recording was held out, {said}" in page(replace(finding, proof=None, recordings=fitted)).text
    assert f"The held-out recordings were not evaluated together, {said}" in page(replace(finding, proof=None)).text
    assert said not in page(finding).text


def test_where_nothing_was_put_in_nothing_is_shown_of_it() -> None:
    for finding in (wing_finding(), force_finding()):
        shown = page(with_verdict(finding, "adequate"))
        assert not re.search(r"\bafter\b", shown.text.replace("misfit after the best nominal refit", ""))
        assert "No recording was held out" not in shown.text
        assert shown.count("circle", "before") > 0
        assert all(shown.count(tag, "after") == 0 for tag in ("circle", "path"))


def test_cells_that_are_not_significant_are_hatched() -> None:
    finding = wing_finding()
    first = finding.missing[0]
    sure = replace(first, errors=times(first.errors, 1e-9))
    unsure = replace(first, errors=times(first.errors, 1e9))
    assert page(replace(finding, missing=(sure,))).count("path", "faint") == 0
    shown = page(replace(finding, missing=(unsure,)))
    hatched = [a["d"] or "" for tag, a in shown.tags if tag == "path" and a.get("class") == "faint"]
    (runs,) = [re.findall(r"h([\d.]+)v", d) for d in hatched]
    assert len(runs) == 12, "a rectangle for each station"
    assert [float(width) for width in runs] == pytest.approx([348 - 52 + 0.2] * 12), "over the whole beat"
    assert "No missing load is significant" in shown.text


def test_the_drawing_of_the_wing_keeps_its_proportions() -> None:
    finding = wing_finding()
    path = next(a["d"] or "" for tag, a in page(finding).tags if tag == "path" and a.get("class") == "outline")
    points = [tuple(map(float, p.split())) for p in re.split("[MLZ]", path) if p]
    assert len(points) == len(finding.outline)
    scales = [
        math.dist(points[i], points[j]) / math.dist(finding.outline[i], finding.outline[j])
        for i, j in ((0, 4), (0, 9), (3, 6))
    ]
    assert max(scales) == pytest.approx(min(scales), rel=2e-3)


def test_no_curve_of_a_series_crosses_a_gap() -> None:
    finding = wing_finding()
    (one, *_) = finding.overlays
    times = tuple(0.1 * k + (3.0 if k >= 10 else 0.0) for k in range(len(one.phase)))
    steady = replace(one, times=tuple(0.1 * k for k in range(len(one.phase))))
    curves = {
        name: sum(
            tag == "path" and a.get("class") == "curve after"
            for tag, a in page(replace(finding, overlays=(given,))).tags
        )
        for name, given in (("steady", steady), ("gap", replace(steady, times=times)))
    }
    assert curves["gap"] == curves["steady"] + 2, "the simulation and the residual are in two parts each"


def test_what_is_left_out_of_the_page_is_counted() -> None:
    finding = wing_finding()
    shown = page(replace(finding, overlays=finding.overlays * 3, missing=finding.missing * 4)).text
    assert "6 more in the JSON." in shown
    assert "2 more, with smaller loads" in shown
    assert (
        f"{len(finding.missing) * 20 - 30} more, with smaller loads, are in the JSON."
        in page(replace(finding, missing=finding.missing * 20)).text
    )


def test_each_effect_is_listed_and_improbable_pairs_are_counted() -> None:
    finding = wing_finding()
    one = next(h for h in finding.hypotheses if h.effects)
    singles = tuple(replace(one, effects=(f"e{k}",), title=f"single {k}", probability=0.0) for k in range(12))
    pairs = tuple(
        replace(one, effects=("a", f"b{k}"), title=f"pair {k}", probability=0.002 - k * 1e-4) for k in range(40)
    )
    shown = page(replace(finding, hypotheses=(*finding.hypotheses, *pairs, *singles)))
    assert all(f"single {k}" in shown.texts for k in range(12))
    assert [k for k in range(40) if f"pair {k}" in shown.texts] == list(range(11)), "those with at least 0.1 %"
    assert "has 29 more, of several effects and each with a probability below 0.1" in shown.text


def test_the_best_three_proposals_are_shown_with_their_cost_and_what_changes() -> None:
    finding = wing_finding()
    cost = AdvisedCost(1, 400, 12.5, 28.0)
    place = AdvisedPlace(0.85, 0.9, 0.1, 0.4, 3.0)
    advice = (
        Advice("w1", 3.0, 0.9, ("a",), kind="markers", recording="slow", cost=cost, places=(place,)),
        Advice("w2", 2.0, None, ("a",), kind="repeat", recording="fast", cost=cost),
        Advice("w3", 1.0, 0.2, ("a",), kind="sensor", recording="fast", cost=cost, channels=("force_z",)),
        Advice("w4", 1.0, 0.1, ("a",), recording="other", change="with a start 2 times as large"),
    )
    text = page(replace(finding, advice=advice)).text
    assert "slow again, further markers at 85 % of the span, 90 % of the chord" in text
    assert "fast again, 28 beats" in text
    assert "fast again, with force_z" in text
    assert "not computed" in text
    assert text.count("13 s") + text.count("12 s") == 3
    assert "The finding as JSON has 1 more." in text
    assert "start 2 times" not in text
