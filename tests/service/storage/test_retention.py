"""Whatever the wall clock does, nothing is deleted before its time, and everything after it."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from sqlalchemy import delete, select, text

from wingfit.service.storage.clock import DAY, ServiceClock
from wingfit.service.storage.database import Database
from wingfit.service.storage.retention import Housekeeping
from wingfit.service.storage.store import timestamp
from wingfit.service.storage.tables import ClockRow, DatasetRow, DiagnosisRow, RunRow

KEEP_DAYS = 3
BEGAN = datetime(2026, 11, 5, tzinfo=UTC)
HOUR = 3600.0
TOLERANCE = 0.01  # wall times are stored in microseconds

Step = tuple[str, float]
SPANS = st.floats(0, 2 * DAY)
PASSES = st.tuples(st.just("pass"), SPANS)
TIDIES = st.tuples(st.just("tidy"), st.just(0.0))
ENDS = st.tuples(st.just("end"), st.just(0.0))
JUMPS = st.tuples(st.just("jump"), st.floats(-400 * DAY, 400 * DAY) | st.floats(-2 * DAY, 2 * DAY))
STOPS = st.tuples(st.just("stop"), SPANS | st.floats(0, 40 * DAY))


class World:
    """A server, the true time, and a wall clock that may say anything."""

    def __init__(self, database: Database) -> None:
        self.true, self.offset, self.booted = 0.0, 0.0, 0.0
        self.ended: dict[str, float] = {}
        self.seen: dict[str, float] = {}
        self.starts: dict[str, int] = {}
        self.deleted: dict[str, float] = {}
        self._database = database
        self._count = 0
        with database.write() as session:
            for table in (ClockRow, RunRow, DiagnosisRow, DatasetRow):
                session.execute(delete(table))
            session.add(dataset())
        self.start()

    def wall(self) -> datetime:
        return BEGAN + timedelta(seconds=self.true + self.offset)

    def start(self) -> None:
        self.booted = self.true
        clock = ServiceClock(self.wall, lambda: self.true - self.booted)
        self._housekeeping = Housekeeping(self._database, KEEP_DAYS, self._on_deleted, clock)
        self.starts = {job: count + 1 for job, count in self.starts.items()}

    def do(self, step: Step) -> None:
        kind, amount = step
        match kind:
            case "pass":
                self.true += amount
            case "jump":
                self.offset += amount
            case "stop":
                self.true += amount
                self.start()
            case "end":
                self._end()
            case "tidy":
                self._housekeeping.tidy()
                self.seen = {job: self.seen.get(job, self.true) for job in self.ended}

    def _end(self) -> None:
        self._count += 1
        job = f"job_{self._count}"
        with self._database.write() as session:
            session.add(ended_job(job, timestamp(self.wall()), diagnosis=self._count % 2 == 0))
        self.ended[job], self.starts[job] = self.true, 0

    def _on_deleted(self, job: str) -> None:
        self.deleted[job] = self.true


def dataset() -> DatasetRow:
    return DatasetRow(
        id="ds",
        name="toy",
        kind="tracks",
        description="",
        filename="toy.zip",
        created_at="",
        sha256="",
        size_bytes=0,
        markers=0,
        recordings=[],
    )


def ended_job(job_id: str, finished_at: str, *, diagnosis: bool = False) -> RunRow | DiagnosisRow:
    row = DiagnosisRow() if diagnosis else RunRow()
    row.id, row.name, row.dataset_id, row.spec, row.state, row.wish = job_id, "", "ds", {}, "SUCCEEDED", "NONE"
    row.created_at, row.finished_at, row.kind, row.evaluations, row.elapsed_seconds = "", finished_at, "tracks", 0, 0.0
    return row


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Database]:
    opened = Database(tmp_path_factory.mktemp("retention"))
    yield opened
    opened.close()


def left(database: Database) -> set[str]:
    with database.read() as session:
        return {*session.scalars(select(RunRow.id)), *session.scalars(select(DiagnosisRow.id))}


@settings(max_examples=80, deadline=None)
@given(steps=st.lists(st.one_of(PASSES, TIDIES, ENDS, JUMPS), min_size=4, max_size=25))
@example(steps=[("jump", -9 * DAY), ("end", 0.0), ("jump", 9 * DAY), ("tidy", 0.0), ("tidy", 0.0)])
def test_while_a_server_runs_no_jump_of_the_wall_clock_counts(database: Database, steps: list[Step]) -> None:
    world = World(database)
    world.do(("tidy", 0.0))
    for step in [*steps, ("tidy", 0.0)]:
        world.do(step)
        for job, when in world.deleted.items():
            assert when - world.ended[job] >= KEEP_DAYS * DAY - TOLERANCE
        if step[0] == "tidy":
            due = {job for job, when in world.seen.items() if world.true - when > KEEP_DAYS * DAY + TOLERANCE}
            assert due <= set(world.deleted)
    assert left(database) == set(world.ended) - set(world.deleted)


@settings(max_examples=80, deadline=None)
@given(steps=st.lists(st.one_of(PASSES, TIDIES, ENDS, STOPS), min_size=4, max_size=25))
def test_with_a_right_wall_clock_nothing_goes_early_over_restarts(database: Database, steps: list[Step]) -> None:
    world = World(database)
    for step in [*steps, ("tidy", 0.0)]:
        world.do(step)
    for job, when in world.deleted.items():
        assert when - world.ended[job] >= KEEP_DAYS * DAY - TOLERANCE


@settings(max_examples=80, deadline=None)
@given(steps=st.lists(st.one_of(PASSES, TIDIES, ENDS, JUMPS, STOPS), min_size=4, max_size=25))
@example(steps=[("end", 0.0), ("tidy", 0.0), ("jump", 9 * DAY), ("stop", 0.0), ("tidy", 0.0)])
def test_each_restart_counts_a_day_too_much_at_most(database: Database, steps: list[Step]) -> None:
    """Where the wall clock jumps while no process runs, nothing else says how long that was."""
    world = World(database)
    for step in [*steps, ("tidy", 0.0)]:
        before = set(world.deleted)
        world.do(step)
        for job in set(world.deleted) - before:
            age = world.deleted[job] - world.ended[job]
            assert age + world.starts[job] * DAY >= KEEP_DAYS * DAY - TOLERANCE


def test_a_jump_between_the_end_and_the_tidying_is_no_age(database: Database) -> None:
    """The wall clock is right before and after, but was a year behind when the job ended."""
    world = World(database)
    for step in (("tidy", 0), ("jump", -365 * DAY), ("end", 0), ("jump", 365 * DAY), ("pass", HOUR), ("tidy", 0)):
        world.do(step)
    assert world.deleted == {}
    world.do(("pass", KEEP_DAYS * DAY + 1))
    world.do(("tidy", 0))
    assert set(world.deleted) == {"job_1"}


@pytest.mark.parametrize(
    ("away", "counted"), [(-5.0, 0.0), (0.0, 0.0), (0.4, 0.4), (1.0, 1.0), (1.5, 1.0), (900.0, 1.0)]
)
def test_a_start_counts_the_time_away_up_to_a_day(database: Database, away: float, counted: float) -> None:
    world = World(database)
    world.do(("pass", HOUR))
    world.do(("tidy", 0.0))
    before = seconds(database)
    world.do(("jump", away * DAY))
    world.start()
    world.do(("tidy", 0.0))
    assert seconds(database) - before == pytest.approx(counted * DAY, abs=TOLERANCE)


def seconds(database: Database) -> float:
    with database.read() as session:
        return session.scalars(select(ClockRow.service_seconds)).one()


def test_a_jump_is_logged(database: Database, caplog: pytest.LogCaptureFixture) -> None:
    world = World(database)
    world.do(("tidy", 0.0))
    for step in (("pass", HOUR), ("jump", 0.9 * DAY), ("tidy", 0)):
        world.do(step)
    assert caplog.records == []
    for step in (("pass", 2 * HOUR), ("jump", -500 * DAY), ("tidy", 0)):
        world.do(step)
    (record,) = caplog.records
    assert (record.levelno, record.name) == (logging.WARNING, "wingfit")
    assert "the wall clock jumped by -500.0 days within 2.0 hours" in record.getMessage()
    assert seconds(database) == 3 * HOUR
    caplog.clear()
    world.do(("jump", 30 * DAY))
    world.start()
    world.do(("tidy", 0))
    assert "last ran 30.0 days ago; WINGFIT_KEEP_DAYS counts 1 of them" in caplog.text


def test_ends_are_noted_also_while_nothing_is_deleted(database: Database) -> None:
    world = World(database)
    world._housekeeping._keep_days = None
    for step in (("end", 0), ("tidy", 0), ("pass", (KEEP_DAYS + 1) * DAY), ("tidy", 0)):
        world.do(step)
    assert world.deleted == {}
    world._housekeeping._keep_days = KEEP_DAYS
    world.do(("tidy", 0.0))
    assert set(world.deleted) == {"job_1"}


def test_what_an_earlier_version_left_counts_from_the_first_tidying(database: Database) -> None:
    world = World(database)
    with database.write() as session:
        session.add(ended_job("job_old", "2001-01-01T00:00:00.000000Z"))
    world.ended["job_old"], world.starts["job_old"] = world.true, 0
    for step in (("tidy", 0), ("pass", (KEEP_DAYS - 1) * DAY), ("tidy", 0)):
        world.do(step)
    assert world.deleted == {}
    world.do(("pass", 1.1 * DAY))
    world.do(("tidy", 0.0))
    assert set(world.deleted) == {"job_old"}


def test_a_job_under_way_is_never_deleted(database: Database) -> None:
    world = World(database)
    with database.write() as session:
        row = ended_job("job_on", "")
        row.finished_at, row.state = None, "RUNNING"
        session.add(row)
    for step in (("tidy", 0), ("pass", 50 * DAY), ("tidy", 0), ("pass", 50 * DAY), ("tidy", 0)):
        world.do(step)
    assert left(database) == {"job_on"}


@pytest.mark.parametrize("wall_time", ["", "yesterday", "2026-11-05T00:00:00"])
def test_a_stored_time_that_is_none_counts_nothing(tmp_path: Path, wall_time: str) -> None:
    """A restored database may hold anything."""
    database = Database(tmp_path)
    with database.write() as session:
        session.execute(text("insert into clock values (1, 5.0, :wall)"), {"wall": wall_time})
    Housekeeping(database, KEEP_DAYS, lambda _: None).tidy()
    assert seconds(database) == 5.0
    database.close()
