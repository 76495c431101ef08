"""The guard: one thread inside, the former setting outside, whoever enters and however they leave."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Generator, Iterator

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController, threadpool_limits

from wingfit.records import blas_threads
from wingfit.records.blas_threads import one_blas_thread


@pytest.fixture(autouse=True)
def two_threads() -> Iterator[None]:
    """The setting of the caller, also on a machine with one processor."""
    with threadpool_limits(2):
        yield
        assert threads() == {2}


def threads() -> set[int]:
    """Numbers of threads of the BLAS libraries that are loaded."""
    assert np.linalg.norm([3.0, 4.0]) == 5.0
    return {library["num_threads"] for library in ThreadpoolController().select(user_api="blas").info()}


def test_one_thread_inside_and_the_former_setting_outside() -> None:
    with one_blas_thread:
        assert threads() == {1}
        with one_blas_thread:
            assert threads() == {1}
        assert threads() == {1}
    assert threads() == {2}


def test_a_function_keeps_its_result_and_its_name() -> None:
    @one_blas_thread
    def computed(factor: int) -> set[int]:
        """Doc."""
        return {factor * n for n in threads()}

    assert computed(3) == {3}
    assert computed.__name__ == "computed"
    assert threads() == {2}


def test_restores_after_an_error() -> None:
    with pytest.raises(ValueError, match="no"), one_blas_thread:
        raise ValueError("no")
    assert threads() == {2}


def test_the_last_thread_to_leave_restores() -> None:
    entered, left = threading.Event(), threading.Event()
    seen: list[set[int]] = []

    def other() -> None:
        with one_blas_thread:
            entered.set()
            assert left.wait(60)
            seen.append(threads())

    thread = threading.Thread(target=other)
    with one_blas_thread:
        thread.start()
        assert entered.wait(60)
    assert threads() == {1}  # the other one is still inside
    left.set()
    thread.join(60)
    assert seen == [{1}]
    assert threads() == {2}


def test_many_threads_at_once_never_see_two() -> None:
    wrong: list[int] = []
    libraries = ThreadpoolController().select(user_api="blas").lib_controllers

    def work() -> None:
        for _ in range(500):
            with one_blas_thread:
                wrong.extend(n for library in libraries if (n := library.get_num_threads()) != 1)

    started = [threading.Thread(target=work) for _ in range(8)]
    for thread in started:
        thread.start()
    for thread in started:
        thread.join(60)
    assert not wrong
    assert threads() == {2}


def test_enters_although_somebody_raised_the_threads_inside() -> None:
    with one_blas_thread, threadpool_limits(4):
        assert threads() == {4}
        with one_blas_thread:
            assert threads() == {1}
    assert threads() == {2}


class Steps:
    """A generator, and what it saw."""

    def __init__(self) -> None:
        self.seen: list[set[int]] = []
        self.closed = False

    @one_blas_thread
    def run(self) -> Generator[int, None, str]:
        try:
            for k in range(3):
                self.seen.append(threads())
                yield k
        finally:
            self.closed = True
        return "end"


def test_a_generator_is_inside_only_while_it_computes() -> None:
    steps = Steps()
    between = [threads() for _ in steps.run()]
    assert steps.seen == [{1}] * 3
    assert between == [{2}] * 3


def test_a_generator_returns_what_it_returns() -> None:
    def outer() -> Generator[int, None, None]:
        ended.append((yield from Steps().run()))

    ended: list[str] = []
    assert list(outer()) == [0, 1, 2]
    assert ended == ["end"]


def test_an_abandoned_generator_restores_the_threads() -> None:
    steps = Steps()
    run = steps.run()
    next(run)
    assert threads() == {2}
    del run
    assert steps.closed
    unstarted = steps.run()
    del unstarted
    assert threads() == {2}


def test_an_error_in_a_generator_restores() -> None:
    @one_blas_thread
    def failing() -> Iterator[int]:
        yield 1
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        list(failing())
    assert threads() == {2}


def test_looks_for_libraries_only_after_an_import(monkeypatch: pytest.MonkeyPatch) -> None:
    with one_blas_thread:
        pass

    def refuse() -> None:
        raise AssertionError("looked again")

    monkeypatch.setattr(blas_threads, "ThreadpoolController", refuse)
    with one_blas_thread:
        assert one_blas_thread._libraries
    monkeypatch.setitem(sys.modules, "an_import", sys)
    with pytest.raises(AssertionError, match="looked again"), one_blas_thread:
        pass
    monkeypatch.undo()
    with one_blas_thread:
        assert threads() == {1}


LATER = """
import numpy
from threadpoolctl import ThreadpoolController
from wingfit.records.blas_threads import one_blas_thread
def threads():
    return [library["num_threads"] for library in ThreadpoolController().select(user_api="blas").info()]
with one_blas_thread:
    before = threads()
    import scipy.linalg
    from threadpoolctl import threadpool_limits
    threadpool_limits(3)  # of both, of which only the first is known
    assert threads() == [3, *(3 for _ in before)], threads()
    with one_blas_thread:
        assert set(threads()) == {1}, threads()
    assert set(threads()) == {1}, threads()
assert 3 in threads(), threads()  # of the second, as it was found
"""

FORK = """
import os, threading
from wingfit.records.blas_threads import one_blas_thread
stop = threading.Event()
def work():
    while not stop.is_set():
        with one_blas_thread:
            pass
thread = threading.Thread(target=work)
thread.start()
for _ in range(100):
    child = os.fork()
    if not child:
        with one_blas_thread:
            os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
stop.set()
thread.join()
"""


def test_a_library_that_is_loaded_inside_is_limited_too() -> None:
    subprocess.run([sys.executable, "-c", LATER], check=True, timeout=60)


def test_a_forked_process_can_enter() -> None:
    subprocess.run([sys.executable, "-W", "ignore", "-c", FORK], check=True, timeout=60)
