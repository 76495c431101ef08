"""A worker process has one copy of a recording, of whatever number of problems it is a part."""

from __future__ import annotations

import gc
import pickle
from dataclasses import replace

from tests.workers import pendulum
from wingfit.calibration.problem import Problem
from wingfit.workers import share
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


def test_recordings_of_no_problem_are_forgotten() -> None:
    before = len(share._received)
    problem = received(sent(pendulum.problem()))
    alone = replace(problem, recordings=(replace(problem.recordings[0], name="for a moment"),))
    held = received(sent(alone))
    assert len(share._received) > before
    del held, problem
    gc.collect()
    assert len(share._received) == before
