"""A worker process has one copy of a recording, of whatever number of problems it is a part."""

from __future__ import annotations

import gc
import pickle
from dataclasses import dataclass, replace
from pathlib import Path

from tests.workers import pendulum
from wingfit.calibration.problem import Problem
from wingfit.records import Recording
from wingfit.workers import make_evaluator, share
from wingfit.workers.share import received


def sent(problem: Problem) -> Problem:
    copy: Problem = pickle.loads(pickle.dumps(problem))  # noqa: S301
    return copy


def test_equal_recordings_are_one_object_and_others_stay() -> None:
    problem = pendulum.problem()
    changed = replace(problem.recordings[0], name="another")
    first = received(sent(problem))
    second = received(sent(replace(problem, free=problem.free[:1], recordings=(changed, *problem.recordings))))
    assert first.key == problem.key
    assert second.recordings[0].name == "another"
    assert second.recordings[0] is not first.recordings[0]
    assert [a is b for a, b in zip(first.recordings, second.recordings[1:], strict=True)] == [True] * len(
        problem.recordings
    )


@dataclass(frozen=True)
class Identities:
    """Notes which object a recording is, as an empty file in ``folder``."""

    folder: Path

    def __call__(self, _: object, recording: Recording) -> None:
        (self.folder / f"{recording.name}-{id(recording)}").touch()


def test_a_worker_process_gets_them_once(tmp_path: Path) -> None:
    problem = pendulum.problem(Identities(tmp_path))
    evaluator = make_evaluator("processes", 1)
    try:
        for free in (problem.free, problem.free[:1]):
            evaluator.evaluate(replace(problem, free=free), pendulum.population(3)[:, : len(free)])
    finally:
        evaluator.close()
    assert len(list(tmp_path.iterdir())) == len(problem.recordings)


def test_recordings_of_no_problem_are_forgotten() -> None:
    gc.collect()
    before = len(share._received)
    problem = received(sent(pendulum.problem()))
    alone = replace(problem, recordings=(replace(problem.recordings[0], name="for a moment"),))
    held = received(sent(alone))
    assert len(share._received) > before
    del held, problem
    gc.collect()
    assert len(share._received) == before
