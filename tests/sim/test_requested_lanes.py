"""A wrong number of lanes in the environment is an error of the command line, without a traceback."""

from __future__ import annotations

import sys

import pytest

from wingfit.cli import main as cli
from wingfit.sim.requested_lanes import VARIABLE, requested_lanes


@pytest.mark.parametrize("words", [("effects",), ("diagnose", "nowhere", "--local"), ("serve", "--help")])
def test_a_wrong_number_is_an_error_with_code_1(
    words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(VARIABLE, "3")
    monkeypatch.setattr(sys, "argv", ["wingfit", *words])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 1
    assert capsys.readouterr().err == "error: WINGFIT_LANES is '3'; it must be one of 2, 4, 8, or unset\n"


@pytest.mark.parametrize(("value", "lanes"), [("", None), (" 2 ", 2), ("8", 8)])
def test_a_possible_number_is_returned(value: str, lanes: int | None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, value)
    assert requested_lanes() == lanes
