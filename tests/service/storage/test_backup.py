"""Copies taken while the service works, put back, and what is forgotten by itself."""

from __future__ import annotations

import sqlite3
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from sqlalchemy import select, text
from typer.testing import CliRunner

from tests.service import toy
from tests.service.conftest import Api, Gate, serving
from tests.service.jobs.test_restart import numbers
from wingfit.cli.main import app as commands
from wingfit.client.client import Client, WingfitError
from wingfit.service.app import create_app
from wingfit.service.settings import Settings
from wingfit.service.storage.backup import BackupError, check, forget_snapshots, restore, snapshot
from wingfit.service.storage.database import FILE_NAME, Database
from wingfit.service.storage.retention import Housekeeping
from wingfit.service.storage.store import ANSWERS_KEPT, timestamp
from wingfit.service.storage.tables import AnswerRow, GenerationRow, RunRow


def test_a_backup_of_a_run_under_way_goes_on_to_the_same_end(api: Api, gate: Gate, tmp_path: Path) -> None:
    archive = toy.archive()
    dataset = api.client.post("/v1/datasets", files={"file": ("toy.zip", archive)}).json()["id"]
    run = api.submit(dataset, max_generations=9, seed=4)["id"]
    gate.let(4)
    api.until(run, lambda now: now["generations"] == 4)
    file, folder = tmp_path / "wings.sqlite3", tmp_path / "again"
    with Client(str(api.client.base_url)) as client:
        assert client.backup(file) == file
    gate.let(100)
    assert api.finish(run)["state"] == "SUCCEEDED"
    restore(file, folder)
    app = create_app(Settings(data=folder), engine=toy.ToyEngine(), make_evaluator=toy.NoEvaluator)
    with serving(app) as other:
        again = Api(other)
        assert again.finish(run)["state"] == "SUCCEEDED"
        assert numbers(again, run) == numbers(api, run)
        assert again.get(f"/v1/runs/{run}/genome") == api.get(f"/v1/runs/{run}/genome")
        assert other.get(f"/v1/datasets/{dataset}/archive").content == archive


def test_copies_leave_nothing_behind(api: Api, settings: Settings) -> None:
    before = sorted(path.name for path in settings.data.iterdir())
    for _ in range(3):
        answer = api.client.get("/v1/backup")
        assert answer.content.startswith(b"SQLite format 3")
        assert int(answer.headers["Content-Length"]) == len(answer.content)
    assert sorted(path.name for path in settings.data.iterdir()) == before
    with pytest.raises(BackupError, match="cannot write into"):
        snapshot(settings.data / "gone")
    (settings.data / "copy-left.backup").write_bytes(b"x")
    forget_snapshots(settings.data)
    assert sorted(path.name for path in settings.data.iterdir()) == before


def test_only_whole_copies_are_put_back(tmp_path: Path) -> None:
    data = tmp_path / "data"
    Database(data).close()
    copy = snapshot(data).rename(tmp_path / "copy")
    check(copy)
    damaged, other, cut = tmp_path / "damaged", tmp_path / "other", tmp_path / "cut"
    body = bytearray(copy.read_bytes())
    body[4096 * 2 : 4096 * 3] = b"\xff" * 4096
    damaged.write_bytes(body)
    with sqlite3.connect(other) as connection:
        connection.execute("create table t (x)")
    connection.close()
    cut.write_bytes(copy.read_bytes()[:5000])
    for bad in (damaged, other, cut, tmp_path / "missing"):
        with pytest.raises(BackupError):
            restore(bad, tmp_path / "new")
        assert not (tmp_path / "new" / FILE_NAME).exists()
    with pytest.raises(BackupError, match="already; move that away"):
        restore(copy, data)
    with sqlite3.connect(copy) as connection:
        connection.execute("update alembic_version set version_num = '9999'")
    connection.close()
    with pytest.raises(BackupError, match="newer wingfit"):
        restore(copy, tmp_path / "new")
    assert not (tmp_path / "new" / FILE_NAME).exists()


def test_the_command_line_copies_and_puts_back(api: Api, tmp_path: Path, settings: Settings) -> None:
    api.upload(name="kept")
    file, runner = tmp_path / "wings.sqlite3", CliRunner()
    url = ["--url", str(api.client.base_url)]
    assert runner.invoke(commands, ["backup", str(file), *url]).exit_code == 0
    again = runner.invoke(commands, ["backup", str(file), *url])
    assert isinstance(again.exception, WingfitError)
    assert "--force" in str(again.exception)
    assert runner.invoke(commands, ["backup", str(file), "--force", *url]).exit_code == 0
    busy = runner.invoke(commands, ["backup", str(tmp_path / "b"), "--data", str(settings.data)])
    assert "leave --data out" in str(busy.exception)
    assert runner.invoke(commands, ["restore", str(file), "--data", str(tmp_path / "new")]).exit_code == 0
    offline = ["backup", str(tmp_path / "c"), "--data", str(tmp_path / "new")]
    assert runner.invoke(commands, offline).exit_code == 0
    check(tmp_path / "c")
    nothing = runner.invoke(commands, ["backup", str(tmp_path / "d"), "--data", str(tmp_path / "none")])
    assert "holds no wingfit.sqlite3" in str(nothing.exception)


def test_jobs_that_ended_long_ago_are_forgotten_where_it_is_asked_for(tmp_path: Path) -> None:
    settings = Settings(data=tmp_path)
    with serving(create_app(settings, engine=toy.ToyEngine(), make_evaluator=toy.NoEvaluator)) as client:
        api = Api(client)
        dataset = api.upload()["id"]
        old, new = (str(api.submit(dataset)["id"]) for _ in range(2))
        for run in (old, new):
            api.finish(run)
    database, told = Database(tmp_path), list[str]()
    assert Housekeeping(database, None, told.append).tidy() == 0  # from which on it counts
    with database.write() as session:
        earlier = text("update run set ended_at_service_seconds = ended_at_service_seconds - :by where id = :id")
        session.execute(earlier, {"by": timedelta(days=30, minutes=1).total_seconds(), "id": old})
    assert Housekeeping(database, 31, told.append).tidy() == 0
    assert Housekeeping(database, 30, told.append).tidy() == 1
    assert told == [old]
    with database.read() as session:
        assert session.scalars(select(RunRow.id)).all() == [new]
        assert set(session.scalars(select(GenerationRow.job_id))) == {new}
    database.close()


def test_answers_to_repeated_requests_are_kept_for_their_time_and_then_deleted(tmp_path: Path) -> None:
    database, minute = Database(tmp_path), timedelta(minutes=1)
    ages = {
        "new": timedelta(0),
        "kept": ANSWERS_KEPT - minute,
        "old": ANSWERS_KEPT + minute,
        "oldest": 2 * ANSWERS_KEPT,
    }
    insert = text("insert into answer values ('p', :key, 'f', 200, 'l', '{}', :made)")
    with database.write() as session:
        for key, age in ages.items():
            session.execute(insert, {"key": key, "made": timestamp(datetime.now(UTC) - age)})
    Housekeeping(database, None, lambda _: None).tidy()
    with database.read() as session:
        assert set(session.scalars(select(AnswerRow.key))) == {"new", "kept"}
    database.close()
