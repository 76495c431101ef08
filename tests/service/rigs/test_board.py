"""The open simulations of jobs: who computes which, and what happens to those that get lost."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from wingfit.rigs.rig_model import Simulated
from wingfit.service.rigs.board import SILENT_SECONDS, Board, Call

ONE, TWO, THREE = (Call("swing", (), {"rate": rate}) for rate in (1.0, 2.0, 3.0))
DONE = Simulated(np.ones((2, 1)), None)


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def board(clock: Clock) -> Board:
    made = Board(clock)
    made.put("run_1", [ONE, TWO, THREE])
    return made


def test_each_call_goes_to_one_driver(board: Board) -> None:
    assert board.take("run_1", "ann", 2) == [ONE, TWO]
    assert board.take("run_1", "bob", 2) == [THREE]
    assert board.take("run_1", "bob", 2, [THREE.key]) == []
    assert board.take("run_2", "bob", 2) == []


def test_what_a_silent_driver_took_is_offered_again(board: Board, clock: Clock) -> None:
    assert len(board.take("run_1", "ann", 3)) == 3
    clock.now = SILENT_SECONDS - 1.0
    assert board.take("run_1", "bob", 3) == []
    board.hear("run_1", "ann")
    clock.now = SILENT_SECONDS + 1.0
    assert board.take("run_1", "bob", 3) == []
    clock.now = 2 * SILENT_SECONDS
    assert board.take("run_1", "bob", 3) == [ONE, TWO, THREE]


def test_an_answer_that_got_lost_is_sent_again(board: Board) -> None:
    assert board.take("run_1", "ann", 2) == [ONE, TWO]
    assert board.take("run_1", "ann", 3, [TWO.key]) == [ONE, THREE]


def test_a_driver_that_leaves_gives_back_what_it_took(board: Board) -> None:
    board.take("run_1", "ann", 3)
    assert board.attended("run_1")
    board.release("run_1", "ann")
    assert not board.attended("run_1")
    assert board.take("run_1", "bob", 3) == [ONE, TWO, THREE]


def test_a_call_that_two_batches_need_is_computed_once(board: Board) -> None:
    board.put("run_1", [ONE])
    assert len(board.take("run_1", "ann", 9)) == 3
    assert board.given_call("run_1", ONE.key) == ONE
    board.settle("run_1", {ONE.key: DONE})
    assert board.given_call("run_1", ONE.key) is None
    assert board.results("run_1", [ONE.key]) == {ONE.key: DONE}
    board.withdraw("run_1", [ONE.key])
    assert board.results("run_1", [ONE.key]) == {ONE.key: DONE}
    board.withdraw("run_1", [ONE.key])
    board.put("run_1", [ONE])
    assert board.take("run_1", "ann", 9, [TWO.key, THREE.key]) == [ONE]


def test_results_for_which_nothing_waits_are_dropped(board: Board) -> None:
    board.withdraw("run_1", [ONE.key])
    board.settle("run_1", {ONE.key: DONE})
    assert board.results("run_1", [ONE.key]) is None
    assert board.take("run_1", "ann", 1) == [TWO]
    board.clear("run_1")  # the job went back to the queue
    assert not board.attended("run_1")
    assert board.take("run_1", "ann", 9) == []
    assert board.given_call("run_1", TWO.key) == TWO  # its result is still wanted
    board.forget("run_1")
    assert board.given_call("run_1", TWO.key) is None


def test_a_batch_waits_for_its_last_result(board: Board) -> None:
    board.settle("run_1", {ONE.key: DONE})
    assert board.results("run_1", [ONE.key, TWO.key]) is None
    late = threading.Timer(0.05, board.settle, ["run_1", {TWO.key: DONE}])
    late.start()
    assert board.results("run_1", [ONE.key, TWO.key]) == {ONE.key: DONE, TWO.key: DONE}
    late.join()


def test_keys_tell_calls_apart() -> None:
    again = Call("swing", (), {"rate": 1.0})
    others = Call("swing", ("leak",), {"rate": 1.0}), Call("fall", (), {"rate": 1.0}), Call("swing", (), {"rat": 1.0})
    assert ONE.key == again.key
    assert len({ONE.key, TWO.key, *(other.key for other in others)}) == 5
