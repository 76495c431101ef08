from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.reliability import COMPARED, SEARCHES, Log, Point, Search, Trial, figures, row, share, staging


def search(end: float, *, simulations: int = 200, error: str | None = None) -> Search:
    points = () if error else (Point(50, 50, 2.0), Point(100, simulations, end))
    return Search(100, simulations, 1.0, points, (2,), agreed=True, error=error)


def made(seed: int, *ends: float, newton: float = 1.0) -> Trial:
    """A trial with a floor of 1; ``ends`` of the searches in their order."""
    return Trial(8, seed, 1.1, newton, dict(zip(SEARCHES, map(search, ends), strict=False)))


def test_the_floor_is_the_least_of_all_ends_and_of_the_truth() -> None:
    assert made(1, 1.5, 0.9).floor == pytest.approx(0.9)
    assert made(1, 1.5, 1.4, newton=1.3).floor == pytest.approx(1.1)


def test_a_search_that_fails_has_not_reached_the_floor() -> None:
    failed = Trial(8, 2, 1.1, 1.0, {"auto, staged": search(0.0, error="the start fails")})
    found = row("auto, staged", [made(1, 1.0, 1.005), failed])
    assert (found["reached"], found["of"], found["errors"], found["ever_reached"]) == (1, 2, 1, 1)
    assert found["worst_ratio"] == pytest.approx(1.005)


def test_the_interval_is_that_of_wilson() -> None:
    assert share(45, 50) == {"reached": 45, "of": 50, "percent": 90.0, "interval_percent": [80.8, 95.0]}


def test_modes_are_compared_on_truths_that_both_have_searched() -> None:
    done = [made(1, 1.0, 1.0, 1.0, 1.2), made(2, 1.0, 1.0, 1.0, 1.0), made(3, 1.0, 1.0, 1.0)]
    found = staging("genetic", done)
    assert (found["truths"], found["both_reach"], found["only_staged_reaches"]) == (2, 1, 1)
    assert found["joint"]["percent"] == pytest.approx(50.0)
    assert figures(done, 2)["genetic_reliability_percent"] == pytest.approx(100.0)


def test_a_run_resumes_from_its_log(tmp_path: Path) -> None:
    path, names = tmp_path / "log.jsonl", [name for name in SEARCHES if name != COMPARED]
    done = made(1, 1.0, 1.2, 1.0)
    Log(path).add(done)
    with path.open("a", encoding="utf-8") as file:
        file.write('{"bodies": 8, "seed": 2, "tr')  # cut off
    again = Log(path)
    assert again.get(8, 1, names) == done
    assert again.get(8, 1, SEARCHES) is None
    assert again.get(4, 1, names) is None
    assert again.get(8, 2, names) is None
    failed = Trial(8, 2, failure="the true wing fails")
    again.add(failed)
    assert Log(path).get(8, 2, SEARCHES) == failed
