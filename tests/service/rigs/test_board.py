"""The open simulations of jobs: who computes which, and what happens to those that get lost."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from wingfit.rigs.rig_model import Simulated
from wingfit.service.rigs.board import OVERDUE_SECONDS, SILENT_SECONDS, Board, Call, DriverError

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
    assert board.take("run_1", "ann", 0, [ONE.key, TWO.key, THREE.key]) == []
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


def test_a_result_is_there_until_it_is_withdrawn(board: Board) -> None:
    board.put("run_1", [ONE])
    assert len(board.take("run_1", "ann", 9)) == 3
    assert board.given_call("run_1", ONE.key) == ONE
    board.settle("run_1", "ann", {ONE.key: DONE})
    assert board.given_call("run_1", ONE.key) is None
    assert board.results("run_1", [ONE.key]) == {ONE.key: DONE}
    board.withdraw("run_1", [ONE.key])
    board.put("run_1", [ONE])
    assert board.take("run_1", "ann", 9, [TWO.key, THREE.key]) == [ONE]


def test_after_a_restart_a_driver_keeps_what_it_computes(clock: Clock) -> None:
    after = Board(clock)
    assert after.take("run_1", "ann", 1, [ONE.key]) == []  # before the job has put up anything
    after.put("run_1", [ONE, TWO])
    assert after.take("run_1", "ann", 0, [ONE.key]) == []
    assert after.take("run_1", "bob", 9) == [TWO]
    assert after.given_call("run_1", ONE.key) == ONE


def test_a_simulation_that_hangs_is_offered_to_a_second_driver(board: Board, clock: Clock) -> None:
    assert board.take("run_1", "ann", 1) == [ONE]
    for clock.now in np.arange(0.0, OVERDUE_SECONDS, SILENT_SECONDS / 2):
        board.take("run_1", "ann", 0, [ONE.key])
        assert ONE not in board.take("run_1", "bob", 1, [TWO.key, THREE.key])
    clock.now = OVERDUE_SECONDS + 1.0
    board.take("run_1", "ann", 0, [ONE.key])
    assert board.take("run_1", "bob", 1, [TWO.key, THREE.key]) == [ONE]


def test_an_error_of_the_simulation_reaches_the_job(board: Board) -> None:
    board.give_up("run_1", "NameError: name 'sin' is not defined")
    with pytest.raises(DriverError, match="NameError: name 'sin' is not defined"):
        board.results("run_1", [ONE.key])


def test_nothing_stays_of_jobs_that_have_ended(board: Board) -> None:
    board.take("run_1", "ann", 9)
    board.forget("run_1")
    board.release("run_1", "ann")
    board.withdraw("run_1", [ONE.key])
    board.clear("run_1")
    assert not board.attended("run_1")
    assert board._desks == {}


def test_results_for_which_nothing_waits_are_dropped(board: Board) -> None:
    board.withdraw("run_1", [ONE.key])
    board.settle("run_1", "ann", {ONE.key: DONE})
    assert board.results("run_1", [ONE.key]) is None
    assert board.take("run_1", "ann", 1) == [TWO]
    board.clear("run_1")  # the job went back to the queue
    assert not board.attended("run_1")
    assert board.take("run_1", "ann", 9) == []
    assert board.given_call("run_1", TWO.key) == TWO  # its result is still wanted
    board.forget("run_1")
    assert board.given_call("run_1", TWO.key) is None


def test_a_batch_waits_for_its_last_result(board: Board) -> None:
    board.settle("run_1", "ann", {ONE.key: DONE})
    assert board.results("run_1", [ONE.key, TWO.key]) is None
    late = threading.Timer(0.05, board.settle, ["run_1", "ann", {TWO.key: DONE}])
    late.start()
    assert board.results("run_1", [ONE.key, TWO.key]) == {ONE.key: DONE, TWO.key: DONE}
    late.join()


def test_keys_tell_calls_apart() -> None:
    again = Call("swing", (), {"rate": 1.0})
    others = Call("swing", ("leak",), {"rate": 1.0}), Call("fall", (), {"rate": 1.0}), Call("swing", (), {"rat": 1.0})
    assert ONE.key == again.key
    assert len({ONE.key, TWO.key, *(other.key for other in others)}) == 5
