"""What commands print, without a server: numbers, states, and text that cannot steer the terminal."""

from __future__ import annotations

from typing import Any

import pytest

from wingfit.cli import results
from wingfit.cli.base import output
from wingfit.cli.base.output import duration, mm, number
from wingfit.cli.jobs import state_word
from wingfit.cli.simulate import marker_distances


def test_the_error_of_a_gene_that_starts_at_zero_is_in_its_unit(capsys: pytest.CaptureFixture[str]) -> None:
    one: Any = {"name": "drive_harmonics.cos2", "nominal": 0.0, "best": 3.4e-5, "unit": "rad", "lower": -0.1}
    one |= {"upper": 0.1, "searched": True, "standard_error_percent": 0.64, "identifiable": True}
    results.print_genes([one | {"standard_error": 3.2e-5}])
    shown = capsys.readouterr().out
    assert "± 3.2e-05 rad" in shown
    assert "not different from zero" in shown
    assert "%" not in shown
    assert results.identifiable(one | {"standard_error": 1.6e-5}) == "yes"
    assert results.identifiable(one | {"standard_error": 3.2e-5, "nominal": 1e-3}) == "yes"
    assert results.identifiable(one) == "yes", "answers of earlier versions have no standard_error"


def test_the_state_says_what_a_job_is_about_to_do() -> None:
    running: Any = {"state": "RUNNING", "pending_action": None}
    words = [state_word(running | {"pending_action": wish}) for wish in (None, "PAUSE", "CANCEL")]
    assert words == ["RUNNING", "pausing", "cancelling"]


def test_numbers() -> None:
    assert [duration(s) for s in (None, 7.4, 192, 3765)] == ["–", "0:07", "3:12", "1:02:45"]
    assert [mm(v) for v in (None, 2.346)] == ["–", "2.35"]
    assert [number(v) for v in (None, 12345678.0, 0.25)] == ["–", "1.235e+07", "0.25"]
    assert [number(v, 2, "%") for v in (109.6, 12.34, 3456.7, -0.0)] == ["110 %", "12 %", "3457 %", "0 %"]
    assert number(3.0, unit="Hz") == "3 Hz"


def test_marker_distances_count_only_what_was_recorded() -> None:
    tracks: Any = {
        "markers": ["a", "b"],
        "recorded_mm": [[[0.0, 0.0, 0.0], [None] * 3], [[0.0, 0.0, 0.0], [None] * 3]],
        "simulated_mm": [[[3.0, 4.0, 0.0], [1.0] * 3], [[0.0, 0.0, 1.0], [1.0] * 3]],
    }
    assert marker_distances(tracks) == {"a": 3.0, "b": None}


def test_a_name_does_not_steer_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    output.table(["name", ">n"], [["\x1b[31mred\x1b]0;title\x07\nnext", "1"]])
    output.say("one\ntwo\x1b[0m")
    out = capsys.readouterr().out
    assert not {"\x1b", "\x07", "\x00"} & set(out)
    assert len(out.splitlines()) == 4
