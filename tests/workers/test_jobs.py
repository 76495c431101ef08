"""The state machine of jobs: every transition, priorities between wishes, and invariants."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from wingfit.workers.jobs import (
    ETA_LONGEST,
    MOST_STARTS,
    Cancel,
    Event,
    Fail,
    Finish,
    Generation,
    IllegalTransition,
    Instruction,
    Job,
    Leave,
    Pause,
    Restart,
    Resume,
    Start,
    State,
    Submit,
    Wait,
    Wish,
    allowed,
    eta_seconds,
    step,
)

EVENTS: dict[str, Event] = {
    "submit": Submit(),
    "start": Start(),
    "generation": Generation(0.5),
    "pause": Pause(),
    "resume": Resume(),
    "cancel": Cancel(),
    "finish": Finish(),
    "fail": Fail("it broke"),
    "wait": Wait(),
    "leave": Leave(),
    "restart": Restart(),
}
E, D, R, K, S, P = (Instruction(i) for i in ("ENQUEUE", "DEQUEUE", "RUN", "STORE", "STOP", "PUBLISH"))

# (state, wish) -> event -> (state, wish, instructions); what is not listed is illegal.
TABLE: dict[str, dict[str, tuple[str, tuple[Instruction, ...]]]] = {
    "nothing": {"submit": ("QUEUED", (E, P))},
    "QUEUED": {
        "start": ("RUNNING", (R, P)),
        "pause": ("PAUSED", (D, P)),
        "cancel": ("CANCELLED", (D, P)),
        "restart": ("QUEUED", (E,)),
    },
    "RUNNING": {
        "generation": ("RUNNING", (K,)),
        "pause": ("RUNNING/PAUSE", ()),
        "cancel": ("RUNNING/CANCEL", ()),
        "finish": ("SUCCEEDED", (S, P)),
        "fail": ("FAILED", (S, P)),
        "wait": ("QUEUED", (S, E, P)),
        "leave": ("RUNNING", ()),
        "restart": ("QUEUED", (E, P)),
    },
    "RUNNING/PAUSE": {
        "generation": ("PAUSED", (K, S, P)),
        "pause": ("RUNNING/PAUSE", ()),
        "resume": ("RUNNING", ()),
        "cancel": ("RUNNING/CANCEL", ()),
        "finish": ("SUCCEEDED", (S, P)),
        "fail": ("FAILED", (S, P)),
        "wait": ("PAUSED", (S, P)),
        "leave": ("RUNNING/PAUSE", ()),
        "restart": ("PAUSED", (P,)),
    },
    "RUNNING/CANCEL": {
        "generation": ("CANCELLED", (K, S, P)),
        "cancel": ("RUNNING/CANCEL", ()),
        "finish": ("CANCELLED", (S, P)),
        "fail": ("CANCELLED", (S, P)),
        "wait": ("CANCELLED", (S, P)),
        "leave": ("RUNNING/CANCEL", ()),
        "restart": ("CANCELLED", (P,)),
    },
    "PAUSED": {"resume": ("QUEUED", (E, P)), "cancel": ("CANCELLED", (P,)), "restart": ("PAUSED", ())},
    "SUCCEEDED": {},
    "FAILED": {},
    "CANCELLED": {},
}


def job_in(standing: str) -> Job | None:
    if standing == "nothing":
        return None
    state, _, wish = standing.partition("/")
    return Job(State(state), Wish(wish or "NONE"), generations=3, progress=0.25)


def standing_of(job: Job) -> str:
    return job.state.value + ("" if job.wish is Wish.NONE else f"/{job.wish.value}")


@pytest.mark.parametrize(("standing", "name"), list(itertools.product(TABLE, EVENTS)))
def test_every_transition(standing: str, name: str) -> None:
    job = job_in(standing)
    assert (name in allowed(job)) == (name in TABLE[standing])
    if name in TABLE[standing]:
        after, instructions = step(job, EVENTS[name])
        assert (standing_of(after), instructions) == TABLE[standing][name]
        assert after.error == ("it broke" if after.state is State.FAILED else None)
        return
    with pytest.raises(IllegalTransition) as refusal:
        step(job, EVENTS[name])
    assert refusal.value.event == name
    assert refusal.value.allowed == allowed(job)
    assert refusal.value.state == (job.state if job else None)


def test_a_job_fails_after_the_third_start_without_progress() -> None:
    job, _ = step(None, Submit())
    for _ in range(MOST_STARTS - 1):
        job = step(step(job, Start())[0], Restart())[0]
        assert job.state is State.QUEUED
    running, _ = step(job, Start())
    given_up, instructions = step(running, Restart())
    assert (given_up.state, instructions) == (State.FAILED, (P,))
    assert "the server ended 3 times in a row" in str(given_up.error)
    assert "(after step 0)" in str(given_up.error)
    assert step(running, Restart(MOST_STARTS + 1))[0].state is State.QUEUED
    assert step(step(running, Leave())[0], Restart())[0].state is State.QUEUED
    assert step(running, Wait())[0].starts == MOST_STARTS - 1
    assert step(step(running, Generation(0.1))[0], Restart())[0].state is State.QUEUED
    assert step(step(running, Generation(0.1, lasting=False))[0], Restart())[0].state is State.FAILED
    assert step(step(running, Cancel())[0], Restart())[0].state is State.CANCELLED


def test_a_refusal_names_the_allowed_events() -> None:
    with pytest.raises(
        IllegalTransition,
        match=r"^cannot resume a job in state QUEUED; allowed: start, pause, cancel, restart$",
    ):
        step(Job(), Resume())
    with pytest.raises(IllegalTransition, match="state RUNNING with a pending cancel; allowed: "):
        step(Job(State.RUNNING, Wish.CANCEL), Resume())
    with pytest.raises(IllegalTransition, match="state FAILED; allowed: nothing: the state is final"):
        step(Job(State.FAILED), Cancel())


@pytest.mark.parametrize("progress", [-0.1, 1.1, math.nan])
def test_progress_is_a_fraction(progress: float) -> None:
    with pytest.raises(ValueError, match=r"it must lie in \[0, 1\]"):
        Generation(progress)


class Lives(RuleBasedStateMachine):
    """A server, its runner and its users act at random; all instructions are carried out."""

    def __init__(self) -> None:
        super().__init__()
        self.job, instructions = step(None, Submit())
        self.queued = self.running = False
        self.stored = 0
        self.cancelled = False
        self.deaths = 0  # since the last lasting generation
        self.best = 0.0
        self.obey(instructions)

    def obey(self, instructions: tuple[Instruction, ...]) -> None:
        for instruction in instructions:
            if instruction is E:
                assert not self.queued
                self.queued = True
            elif instruction is D:
                assert self.queued
                self.queued = False
            elif instruction is R:
                self.running = True
            elif instruction is S:
                assert self.running
                self.running = False
            elif instruction is K:
                self.stored += 1

    def send(self, event: Event) -> None:
        before = self.job
        try:
            self.job, instructions = step(self.job, event)
        except IllegalTransition:
            assert self.job == before
            return
        if isinstance(event, Cancel):
            self.cancelled = True
        assert (P in instructions) == (self.job.state is not before.state)
        self.obey(instructions)

    @precondition(lambda self: self.queued)
    @rule()
    def runner_takes_it(self) -> None:
        self.queued = False
        self.send(Start())

    @precondition(lambda self: self.running)
    @rule(progress=st.floats(0.0, 1.0), lasting=st.booleans())
    def generation_ends(self, progress: float, lasting: bool) -> None:
        count = self.job.generations
        self.best = max(self.best, progress)
        self.deaths = 0 if lasting else self.deaths
        self.send(Generation(progress, lasting))
        assert self.job.generations == count + 1

    @precondition(lambda self: self.running)
    @rule()
    def calibration_ends(self) -> None:
        self.send(Finish())

    @precondition(lambda self: self.running)
    @rule()
    def calibration_breaks(self) -> None:
        self.send(Fail("why"))

    @rule(event=st.sampled_from([Pause(), Resume(), Cancel()]))
    def user_asks(self, event: Event) -> None:
        self.send(event)

    @rule()
    def server_dies_and_restarts(self) -> None:
        self.deaths += self.running
        self.queued = self.running = False
        self.send(Restart(MOST_STARTS))

    @rule()
    def server_stops_and_starts(self) -> None:
        if self.running:
            self.send(Leave())
        self.queued = self.running = False
        self.send(Restart(MOST_STARTS))

    @invariant()
    def what_ends_the_server_is_given_up_and_nothing_else(self) -> None:
        if self.job.error is not None and self.job.error != "why":
            assert self.deaths >= MOST_STARTS
            assert f"ended {MOST_STARTS} times in a row" in self.job.error
        assert self.job.starts <= MOST_STARTS

    @invariant()
    def runner_and_line_agree_with_the_state(self) -> None:
        assert self.running == (self.job.state is State.RUNNING)
        assert self.queued == (self.job.state is State.QUEUED)
        assert self.job.wish is Wish.NONE or self.job.state is State.RUNNING

    @invariant()
    def nothing_is_lost(self) -> None:
        assert self.stored == self.job.generations
        assert self.job.progress >= self.best
        assert self.job.state is not State.SUCCEEDED or self.job.progress == 1.0

    @invariant()
    def cancelling_wins(self) -> None:
        if self.cancelled:
            assert self.job.state is State.CANCELLED or self.job.wish is Wish.CANCEL


Lives.TestCase.settings = settings(max_examples=150, stateful_step_count=30, deadline=None)
TestLives = Lives.TestCase


# -- remaining time -----------------------------------------------------------------------------------------

steps = st.lists(st.tuples(st.floats(0.01, 100.0), st.floats(0.0, 0.1)), min_size=1, max_size=40)


def history_of(increments: list[tuple[float, float]]) -> list[tuple[float, float]]:
    times = itertools.accumulate(dt for dt, _ in increments)
    progress = itertools.accumulate(dp for _, dp in increments)
    return [(t, min(p, 1.0)) for t, p in zip(times, progress, strict=True)]


def test_there_is_no_estimate_before_the_first_progress() -> None:
    assert eta_seconds([]) is None
    assert eta_seconds([(3.0, 0.0), (9.0, 0.0)]) is None


@given(st.floats(0.1, 1e4), st.integers(1, 99))
def test_constant_speed_is_exact(total: float, count: int) -> None:
    history = [(total * k / 100, k / 100) for k in range(1, count + 1)]
    assert eta_seconds(history) == pytest.approx(total * (100 - count) / 100, rel=1e-6)


@given(steps)
def test_never_negative_and_never_infinite(increments: list[tuple[float, float]]) -> None:
    eta = eta_seconds(history_of(increments))
    assert eta is None or 0.0 <= eta < ETA_LONGEST


@given(steps, st.floats(0.1, 10.0))
def test_does_not_depend_on_the_unit_of_time(increments: list[tuple[float, float]], scale: float) -> None:
    history = history_of(increments)
    eta, scaled = eta_seconds(history), eta_seconds([(t * scale, p) for t, p in history])
    if eta is None and scaled is None:
        return
    if eta is None or scaled is None:  # one of the estimates is too long
        there = scaled / scale if scaled is not None else (eta or 0.0) * scale
        assert there >= 0.999 * ETA_LONGEST
    else:
        assert scaled == pytest.approx(eta * scale, rel=1e-6)


def test_is_zero_at_the_end() -> None:
    assert eta_seconds([(5.0, 1.0)]) == 0.0


def test_follows_a_lasting_change_of_speed_but_not_one_slow_generation() -> None:
    even = [(float(k), 0.01 * k) for k in range(1, 31)]
    hiccup = [*even, (34.0, 0.31)]
    assert eta_seconds(hiccup) == pytest.approx(69.0, rel=0.15)
    halved = even + [(30.0 + 2.0 * k, 0.30 + 0.01 * k) for k in range(1, 31)]
    assert eta_seconds(halved) == pytest.approx(2.0 * 40.0, rel=0.15)
