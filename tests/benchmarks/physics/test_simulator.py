from __future__ import annotations

import json
from typing import Any

import pytest

from benchmarks import simulator
from benchmarks.simulator import Peer, add_peer, cost_exponents, main, run_peer

CASE_KEYS = {
    "bodies", "medium", "ms_per_beat", "error_mm", "gflops", "fraction_of_peak", "times_faster_than_scipy",
    "times_faster_than_engine", "engine", "beats_to_periodic", "beats_to_periodic_plain",
}  # fmt: skip
KEYS = {"cases", "cost_exponent", "finished_percent", "search_24_seconds", "energy_error", "cpu"}


def row(bodies: int, medium: str, ms: float) -> dict[str, Any]:
    return {"bodies": bodies, "medium": medium, "ms_per_beat": ms, "times_faster_than_engine": None, "engine": None}


def test_cost_exponent_is_the_slope_at_fixed_chordwise_division() -> None:
    rows = [row(n, "air", 0.1 * n**1.1) for n in (24, 48, 96)] + [row(n, "vacuum", 0.2 * n**0.9) for n in (24, 48, 96)]
    rows += [row(4, "air", 50.0), row(11, "vacuum", 70.0)]
    assert cost_exponents(rows) == pytest.approx({"air": 1.1, "vacuum": 0.9})


def test_results_of_a_peer_are_added_to_the_row() -> None:
    case = row(24, "air", 2.0)
    add_peer(case, "exudyn", {"cpu_ms_per_beat": 124.0, "error_mm": 0.07, "note": ""})
    add_peer(case, "scipy", {"cpu_ms_per_beat": None, "note": "not finished within 90 s; allow more time"})
    assert case["times_faster_than_engine"] == pytest.approx(62.0)
    assert case["engine"].startswith("exudyn ")
    assert case["times_faster_than_scipy"] is None
    assert "90 s" in case["scipy"]["note"]


def test_peer_that_fails_gives_its_reason() -> None:
    found = run_peer(Peer("abacus", 4, "vacuum"), 10.0)
    assert found["cpu_ms_per_beat"] is None
    assert "abacus" in found["note"]


def test_last_line_is_the_json_object(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(simulator, "QUICK", (4,))
    monkeypatch.setattr(simulator, "ENERGY_BODIES", 4)
    monkeypatch.setattr(simulator, "GENOMES", 18)
    monkeypatch.setattr("sys.argv", ["benchmarks.simulator", "--json", "--quick"])
    main()
    printed = capsys.readouterr()
    found = json.loads(printed.out.splitlines()[-1])
    assert set(found) >= KEYS
    assert "left" in printed.err
    assert [(case["bodies"], case["medium"]) for case in found["cases"]] == [(4, "vacuum"), (4, "air")]
    for case in found["cases"]:
        assert set(case) >= CASE_KEYS
        assert 0.02 < case["error_mm"] <= 0.1
        assert 0.01 < case["fraction_of_peak"] < 1.0
        assert case["ms_per_beat"] < case["default_ms_per_individual"]
        assert case["beats_to_periodic"] <= case["beats_to_periodic_plain"]
    assert 0 <= found["energy_error"] < 0.01
    assert found["random_genomes"]["not_ended_percent"] == 0
