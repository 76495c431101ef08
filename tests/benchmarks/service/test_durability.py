"""The ledger of acknowledged requests detects every kind of loss."""

from __future__ import annotations

from typing import Any

import pytest

from benchmarks.common.files import archive
from benchmarks.durability.clients import outcome, settle
from benchmarks.durability.ledger import KnownRun, Ledger
from benchmarks.durability.workloads import WORKS
from wingfit.records import load_archive

Json = dict[str, Any]


def item(sequence: int, best: float, seconds: float = 0.0) -> Json:
    return {"sequence": sequence, "best": best, "elapsed_seconds": seconds, "eta_seconds": 9 - seconds}


@pytest.fixture
def ledger() -> Ledger:
    return Ledger(runs={"run": KnownRun("genetic 1")})


def test_unchanged_generations_are_no_loss(ledger: Ledger) -> None:
    ledger.history("run", [item(1, 0.5), item(2, 0.4)])
    ledger.history("run", [item(1, 0.5, 7.0), item(2, 0.4), item(3, 0.3)])
    assert (ledger.lost, ledger.acknowledged) == ([], 3)


@pytest.mark.parametrize("later", [[item(1, 0.5)], [item(1, 0.5), item(2, 0.41)], []])
def test_a_missing_or_changed_generation_is_a_loss(ledger: Ledger, later: list[Json]) -> None:
    ledger.history("run", [item(1, 0.5), item(2, 0.4)])
    ledger.history("run", later)
    assert ledger.lost


@pytest.mark.parametrize(
    ("endings", "state", "lost"),
    [
        (("SUCCEEDED",), "SUCCEEDED", False),
        (("SUCCEEDED",), "FAILED", True),
        (("SUCCEEDED",), "CANCELLED", True),
        (("CANCELLED",), "SUCCEEDED", True),  # cancelling was acknowledged
        (("CANCELLED",), "CANCELLED", False),
        (("SUCCEEDED", "CANCELLED"), "CANCELLED", False),  # requested, but the answer was lost
    ],
)
def test_a_run_must_end_in_an_allowed_state(
    ledger: Ledger, endings: tuple[str, ...], state: str, *, lost: bool
) -> None:
    ledger.runs["run"].endings = endings
    answers: dict[str, Json] = {"history": {"items": [item(1, 0.5)]}, "genome": {"g": 1}, "result": {"r": 2}}

    def fetch(path: str) -> Json:
        return answers[path.split("/")[-1].partition("?")[0]]

    settle(ledger, "run", {"state": state, "error": None}, fetch, {"genetic 1": outcome("run", fetch)})
    assert bool(ledger.lost) is lost
    assert ledger.identical == ledger.results == (state == "SUCCEEDED")


def test_a_different_number_in_a_result_is_detected(ledger: Ledger) -> None:
    def fetch(_: str) -> Json:
        return {"items": [item(1, 0.5)]}

    expected = outcome("run", fetch)
    expected["genome"] = {"items": [item(1, 0.5000000001)]}
    settle(ledger, "run", {"state": "SUCCEEDED", "error": None}, fetch, {"genetic 1": expected})
    assert (ledger.results, ledger.identical, ledger.different) == (1, 0, ["run"])


def test_workloads_have_different_names_and_valid_datasets() -> None:
    assert len({work.name for work in WORKS}) == len(WORKS)
    for example in {work.example for work in WORKS}:
        assert archive(example) == archive(example)
        load_archive(archive(example), "x.zip")
