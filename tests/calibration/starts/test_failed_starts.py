"""Starts that fail or do not converge confirm nothing, and are reported; so is a minimum that none confirms."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, replace

import numpy as np
import pytest

from tests.calibration.starts.conftest import Failing, progress_is_sound, ran, step
from tests.calibration.test_search import Here
from wingfit.calibration import search, summary
from wingfit.calibration.estimates.likelihood import ITERATIONS, Step
from wingfit.calibration.preparation import Prepared
from wingfit.calibration.problem import Problem
from wingfit.calibration.result import Result
from wingfit.calibration.search import CalibrationSpec, calibrate
from wingfit.calibration.starts import AGREE, End, Ends, doubts
from wingfit.calibration.summary import summarise
from wingfit.inference.differences import NotSimulatedError
from wingfit.records import Dataset, Genome


def test_a_start_that_cannot_be_simulated_is_passed_over(valleys: Prepared, forces: Dataset) -> None:
    whole, without = (ran(valleys, forces, *s, evaluator=Failing(4.1, 4.3)) for s in ((4.2, 3.0, 1.9), (3.0, 1.9)))
    assert [g.genome for g in whole] == [g.genome for g in without]
    assert (whole[-1].checkpoint["ends"]["tried"], len(whole[-1].checkpoint["ends"]["done"])) == (3, 2)
    with pytest.raises(ValueError, match=r"stage 'joint': Gauss-Newton failed from every start, the first: .*broken"):
        ran(valleys, forces, 4.2, 5.0, evaluator=Failing(-99.0, 99.0))


def test_a_start_that_fails_on_its_way_leaves_what_it_reached(
    valleys: Prepared, forces: Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    starts: list[float] = []

    def two_steps(_: Problem, __: Here, start: dict[str, float], ___: object) -> Iterator[Step]:
        starts.append(start["a"])
        yield replace(step(3.0 - len(starts), converged=False), values=start)
        if len(starts) == 1:
            raise NotSimulatedError("the genome to be differentiated cannot be simulated: broken")
        yield replace(step(4.0 - len(starts), 1), values=start)

    monkeypatch.setattr(search, "iterate", two_steps)
    whole = ran(valleys, forces, 3.0, 0.0)
    assert starts == pytest.approx([3.0, 0.0])
    assert [g.genome["a"] for g in whole] == pytest.approx([3.0, 0.0, 3.0])
    done = whole[-1].checkpoint["ends"]["done"]
    assert [(end["cost"], end["converged"]) for end in done] == [(2.0, False), (2.0, True)]
    (remark,) = doubts(whole[-1].checkpoint)
    assert "of 2 starts of Gauss-Newton, no two converged at the least cost (1 failed, the first: the genome " in remark


@pytest.mark.parametrize(("converged", "tried"), [((1, 1, 1), 2), ((1, 0, 1), 3), ((0, 0, 1), 3)])
def test_a_start_at_the_limit_of_iterations_confirms_none(
    valleys: Prepared, forces: Dataset, monkeypatch: pytest.MonkeyPatch, converged: tuple[bool, ...], tried: int
) -> None:
    left = list(converged)

    def one_step(_: Problem, __: Here, start: dict[str, float], ___: object) -> Iterator[Step]:
        yield replace(step(2.0, ITERATIONS - 1, converged=left.pop(0)), values=start)

    monkeypatch.setattr(search, "iterate", one_step)
    whole = ran(valleys, forces, 3.0, 0.0, -3.0)
    assert (len(whole), whole[-1].checkpoint["ends"]["tried"]) == (tried, tried)
    assert (doubts(whole[-1].checkpoint) == ()) is (sum(converged[:tried]) == 2)
    progress_is_sound(whole)


@pytest.mark.parametrize("starts", [(-3.0, 4.2), (3.0, -3.0, 4.2), (-3.0, 4.2, 4.25)])
def test_if_the_last_start_fails_the_run_is_complete_and_a_resume_repeats_nothing(
    valleys: Prepared, forces: Dataset, starts: tuple[float, ...]
) -> None:
    failing = starts.count(4.2) + starts.count(4.25)
    ready, evaluator = replace(valleys, spec=replace(valleys.spec, axes=("x",))), Failing(4.1, 4.3)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("wingfit.calibration.starts.APART", 0.001)
        whole = ran(ready, forces, *starts, evaluator=evaluator)
        last = whole[-1]
        assert (last.failed, len(last.reasons)) == (failing, failing)
        assert last.reasons[0] == f"start {len(starts) - failing + 1} of Gauss-Newton failed: the genome to be " + (
            "differentiated cannot be simulated: broken"
        )
        assert (last.genome, last.best, last.evaluations) == (whole[-2].genome, whole[-2].best, whole[-2].evaluations)
        assert last.checkpoint["ends"]["tried"] == len(starts)
        assert [g.index for g in whole] == list(range(len(whole)))
        progress_is_sound(whole)
        assert f"({failing} failed, the first: the genome to be differentiated" in doubts(last.checkpoint)[0]
        before = evaluator.individuals
        checkpoint = json.loads(json.dumps(last.checkpoint, allow_nan=False))
        assert list(calibrate(ready.spec, forces, evaluator, checkpoint)) == []
        assert evaluator.individuals == before


def test_a_failed_start_is_reported_with_the_next_iteration(valleys: Prepared, forces: Dataset) -> None:
    whole = ran(valleys, forces, 3.0, 4.2, 1.9, evaluator=Failing(4.1, 4.3))
    (at,) = [
        k for k, g in enumerate(whole) if any(reason.startswith("start 2 of Gauss-Newton") for reason in g.reasons)
    ]
    assert whole[at].failed >= 1
    assert [g.checkpoint["ends"]["tried"] for g in whole[at - 1 : at + 1]] == [1, 2]
    assert doubts(whole[-1].checkpoint) == (), "two others agreed"


def test_another_error_than_a_failed_simulation_ends_the_calibration(
    valleys: Prepared, forces: Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> Iterator[Step]:
        yield step(1.0, converged=False)
        raise ValueError("operands could not be broadcast together")

    monkeypatch.setattr(search, "iterate", broken)
    with pytest.raises(ValueError, match="broadcast"):
        ran(valleys, forces, 3.0, 0.0)


def test_a_start_whose_equations_are_singular_has_failed(
    valleys: Prepared, forces: Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    def singular(_: Problem, __: Here, start: dict[str, float], ___: object) -> Iterator[Step]:
        if start["a"] > 2.0:
            raise np.linalg.LinAlgError("singular matrix")
        yield replace(step(1.0), values=start)

    monkeypatch.setattr(search, "iterate", singular)
    assert "start 1 of Gauss-Newton failed: singular matrix" in ran(valleys, forces, 3.0, 0.0, -3.0)[0].reasons


def test_an_unconfirmed_minimum_is_remarked_in_the_result(forces: Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stages in which the same happened share a remark, which comes first; an agreement is not remarked."""
    names = [recording.name for recording in forces.fitted]
    spec = CalibrationSpec(method="auto", mode="local", population=8, max_generations=1, recordings=tuple(names))
    monkeypatch.setattr("wingfit.calibration.starts.MOST", 1)
    *_, last = calibrate(spec, forces, Here())
    remark = summarise(spec, forces, Here(), last.checkpoint).remarks[0]
    assert remark == (
        f"stages {', '.join(map(repr, names))}: Gauss-Newton had only one start: the minimum is not confirmed; "
        "use a larger population or another seed"
    )
    assert doubts({}) == (), "of a checkpoint of an earlier version"
    assert doubts({"doubts": {"joint": "a", "vacuum": "b"}}) == ("stage 'joint': a", "stage 'vacuum': b")


def test_remarks_on_the_search_come_before_those_on_tracks(
    small: tuple[Dataset, Genome], monkeypatch: pytest.MonkeyPatch
) -> None:
    judged = Result((), (), 1.0, 1.0, None, None, None, ("another",))
    monkeypatch.setattr(summary, "found", lambda *_: {"joint": {}})
    monkeypatch.setattr(summary, "judge", lambda *_: judged)
    result = summarise(CalibrationSpec(), small[0], Here(), {"doubts": {"joint": "not confirmed"}})
    assert result.remarks == ("stage 'joint': not confirmed", "another")
    assert summarise(CalibrationSpec(), small[0], Here(), {}) == judged


def test_a_checkpoint_of_an_earlier_version_resumes(valleys: Prepared, forces: Dataset) -> None:
    whole = ran(valleys, forces, -3.0, 3.0, 4.2, 1.9, evaluator=Failing(4.1, 4.3))
    for cut, generation in enumerate(whole, 1):
        old = json.loads(json.dumps(generation.checkpoint))
        for place in (*old["ends"]["done"], old["ends"]["present"] or {"converged": True}):
            place.pop("converged")
        del old["ends"]["failures"], old["doubts"]
        rest = list(calibrate(valleys.spec, forces, Failing(4.1, 4.3), old))
        assert [(g.genome, g.progress, g.reasons) for g in rest] == [
            (g.genome, g.progress, g.reasons) for g in whole[cut:]
        ]


def test_a_start_of_an_earlier_version_that_fails_on_its_way_confirms_none() -> None:
    made = Ends()
    made.add(step(5.0), last=True)
    made.add(step(5.0, converged=False), last=False)
    assert made.present is not None
    del made.present["converged"]
    assert made.fail(ValueError("broken")) == "start 2 of Gauss-Newton failed: broken"
    assert (made.agreed, made.tried, made.failures, len(made.done)) == (False, 2, ["broken"], 2)


def test_ends_of_an_earlier_version_count_as_converged() -> None:
    stored = [{k: v for k, v in asdict(End.of(step(5.0))).items() if k != "converged"}] * 2
    assert Ends(done=stored, tried=2).agreed


def test_an_end_that_has_not_converged_confirms_none() -> None:
    made = Ends()
    for converged in (True, False):
        made.add(step(5.0, converged=converged), last=True)
    assert not made.agreed
    made.add(step(5.0), last=True)
    assert made.agreed
    made.add(step(5.0 - 2 * AGREE, converged=False), last=True)
    assert not made.agreed, "a lesser cost was reached"
