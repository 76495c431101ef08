"""The pages of effects agree with the code, and their links and sections exist."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.common.svg import Line, Panel, svg
from benchmarks.physics.effect_rigs import rig_of
from docs.generate.effect_figures import LEAST, around_zero, shown_markers, vehicle_panels
from docs.generate.effect_pages import blocks_of, filled, index, page_of
from wingfit.records import Vehicle, Wing
from wingfit.records.dataset import STANDARD_GRAVITY
from wingfit.sim.effects.registry import EFFECTS


def test_a_changed_declaration_is_detected() -> None:
    effect = EFFECTS["camera_shift"]
    text = page_of("camera_shift").read_text(encoding="utf-8")
    changed = replace(effect, size=(replace(effect.size[0], upper=0.25), *effect.size[1:]))
    assert filled(text, blocks_of(effect)) == text
    assert filled(text, blocks_of(changed)) != text
    assert "-0.2 to 0.25 mean chords" in filled(text, blocks_of(changed))


def test_page_without_markers_is_refused() -> None:
    with pytest.raises(ValueError, match=r"no place for 'genes'.*end of genes"):
        filled("# Title\n<!-- genes -->\n", {"genes": "table"})


def test_index_names_every_effect_with_its_rigs() -> None:
    rows = {row.split("]")[0].strip("| ["): row for row in index().splitlines()[2:]}
    assert set(rows) == set(EFFECTS)
    assert "| wing, vehicle |" in rows["tip_loss"]
    assert "| vehicle |" in rows["balance_tilt"]
    assert "| wing |" in rows["camera_shift"]


def test_figure_of_a_vehicle_is_in_millinewtons() -> None:
    effect, rig = EFFECTS["balance_offset"], rig_of("vehicle", quick=False)
    beat, tests = vehicle_panels(rig, effect)
    assert isinstance(rig.description, Vehicle)
    expected = 1e3 * effect.size[0].typical * rig.description.mass * STANDARD_GRAVITY
    assert [line.name for line in beat.lines] == ["x", "z"]
    for line in (*beat.lines, *tests.lines):
        assert line.y == pytest.approx(expected, rel=1e-9)
    assert tests.lines[0].x.tolist() == [1, 2, 3, 4, 5, 6, 7, 8]


def test_figure_of_a_wing_shows_the_tip_or_the_marker_concerned() -> None:
    wing = rig_of("wing", quick=False).description
    assert isinstance(wing, Wing)
    places = {k: marker.position for k, marker in enumerate(wing.markers)}
    tip, mid = shown_markers(wing, EFFECTS["camera_shift"]).values()
    assert places[tip][1] == max(y for _, y, _ in places.values())
    assert places[mid][0] == max(x for x, y, _ in places.values() if y == places[mid][1])
    slipped, neighbour = shown_markers(wing, EFFECTS["marker_slip"]).values()
    assert len({tip, mid, slipped, neighbour}) == 4


def test_axis_of_a_negligible_change_does_not_show_rounding() -> None:
    phase = np.linspace(0.0, 1.0, 9)
    nothing, much = (Line("a", phase, size * np.sin(phase)) for size in (1e-12, 2.0))
    assert around_zero([nothing]) == (-LEAST, LEAST)
    assert around_zero([nothing, much]) == (0.0,)
    flat = svg([Panel("p", "x", "y, mm", (Line("a", phase, 0.0 * phase),), holds=around_zero([nothing]))])
    assert "nan" not in flat
    assert f">{LEAST:g}<" in flat
