"""Migrations, settings of the connections, the lock of the folder."""

from __future__ import annotations

import errno
import os
import sqlite3
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import create_engine, text
from sqlalchemy.exc import IntegrityError, OperationalError

from tests.service import toy
from tests.service.conftest import Api, serving
from tests.service.shapes import valid
from wingfit.client.answers import Dataset, Result, Run
from wingfit.service.app import create_app
from wingfit.service.settings import Settings
from wingfit.service.storage.database import FILE_NAME, Database, DatabaseClosedError, DataFolderError, migrate
from wingfit.service.storage.tables import ArchiveRow, Table


def test_migrations_from_nothing_give_the_tables_that_the_code_means(tmp_path: Path) -> None:
    Database(tmp_path / "new" / "folder").close()
    engine = create_engine(f"sqlite:///{tmp_path / 'new' / 'folder' / FILE_NAME}")
    with engine.connect() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True})
        assert compare_metadata(context, Table.metadata) == []
        assert context.get_current_revision() == "0010"
    engine.dispose()


def test_opening_again_keeps_what_is_there(tmp_path: Path) -> None:
    first = Database(tmp_path)
    with first.write() as session:
        session.execute(text("insert into answer values ('p', 'k', 'f', 200, 'l', '{}', 't')"))
    first.close()
    second = Database(tmp_path)
    with second.read() as session:
        assert session.execute(text("select key from answer")).scalar() == "k"
    second.close()


def test_a_database_of_a_newer_version_is_refused(tmp_path: Path) -> None:
    Database(tmp_path).close()
    with sqlite3.connect(tmp_path / FILE_NAME) as connection:
        connection.execute("update alembic_version set version_num = '9999'")
    connection.close()
    with pytest.raises(DataFolderError, match="newer wingfit"):
        Database(tmp_path)


def test_a_file_that_is_no_database_is_refused_and_kept(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_bytes(b"something else entirely" * 100)
    with pytest.raises(DataFolderError, match="cannot open the database"):
        Database(tmp_path)
    assert (tmp_path / FILE_NAME).read_bytes().startswith(b"something else")


def test_a_folder_that_cannot_be_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(DataFolderError, match="cannot create the data folder"):
        Database(tmp_path / "file" / "data")


def test_a_folder_that_cannot_be_locked_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on NFS without a lock manager; what another server holds is another error."""

    def no_locks(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("fcntl.lockf", no_locks)
    with pytest.raises(DataFolderError, match=r"cannot be locked \(No locks available\).*disk of this machine"):
        Database(tmp_path)


def test_commits_are_durable_and_references_hold(tmp_path: Path) -> None:
    database = Database(tmp_path)
    with database.write() as session:
        found = [session.execute(text(f"pragma {name}")).scalar() for name in ("journal_mode", "synchronous")]
        assert found == ["wal", 2]
        assert session.execute(text("pragma busy_timeout")).scalar() == 10_000
    with pytest.raises(IntegrityError), database.write() as session:
        session.add(ArchiveRow(dataset_id="none", body=b""))
    database.close()


def test_a_write_that_fails_leaves_nothing(tmp_path: Path) -> None:
    database = Database(tmp_path)
    insert = text("insert into answer values ('p', 'k', 'f', 200, 'l', '{}', 't')")
    with pytest.raises(IntegrityError), database.write() as session:  # noqa: PT012  both must be in the block
        session.execute(insert)
        session.execute(insert)
    with database.read() as session:
        assert session.execute(text("select count(*) from answer")).scalar() == 0
    database.close()


def test_readers_cannot_write(tmp_path: Path) -> None:
    database = Database(tmp_path)
    with database.read() as session, pytest.raises(OperationalError, match="readonly"):
        session.execute(text("delete from answer"))
    database.close()


def test_reads_see_one_moment_while_a_write_is_under_way(tmp_path: Path) -> None:
    database = Database(tmp_path)
    insert = text("insert into answer values ('p', :key, 'f', 200, 'l', '{}', 't')")
    count = text("select count(*) from answer")
    with database.read() as reader:
        assert reader.execute(count).scalar() == 0
        with database.write() as writer:
            writer.execute(insert, {"key": "k"})
            with database.read() as other:
                assert other.execute(count).scalar() == 0
        assert reader.execute(count).scalar() == 0
    with database.read() as later:
        assert later.execute(count).scalar() == 1
    database.close()


def test_the_folder_has_one_owner(tmp_path: Path) -> None:
    database = Database(tmp_path)
    with pytest.raises(DataFolderError, match="already serves"):
        Database(tmp_path)
    database.close()
    with pytest.raises(DatabaseClosedError), database.write():
        pass
    Database(tmp_path).close()


def test_what_the_first_schema_stored_is_all_there(tmp_path: Path) -> None:
    """A database of the first release, with a finished run on tracks and one half-way, is migrated and served."""
    engine = create_engine(f"sqlite:///{tmp_path / FILE_NAME}")
    migrate(engine, "0001")
    engine.dispose()
    with sqlite3.connect(tmp_path / FILE_NAME) as connection:
        connection.executescript((Path(__file__).parent / "first_release.sql").read_text())
    connection.close()
    app = create_app(Settings(data=tmp_path), engine=toy.ToyEngine(), make_evaluator=toy.NoEvaluator)
    with serving(app) as client:
        api = Api(client)
        dataset = valid(Dataset, api.get("/v1/datasets/ds_1"))
        assert (dataset.kind, dataset.markers, dataset.recordings[0].channels) == ("tracks", 2, [])
        done = valid(Run, api.run("run_1"))
        assert (dataset.notes, done.notes, done.name) == ("", "", "old")
        assert (done.kind, done.best_mm, done.best_mn) == ("tracks", 1.5, None)
        assert (done.spec.mode, done.spec.method, done.spec.finish, done.spec.seed) == ("staged", "genetic", False, 4)
        result = valid(Result, api.get("/v1/runs/run_1/result"))
        assert (result.kind, result.after_mm) == ("tracks", 1.5)
        noise = result.noise_mm
        assert (done.residual_over_noise, done.fit_badge) == ((1.5 / noise, "wrong") if noise else (None, None))
        (item,) = api.history("run_1")
        assert (item["best_mm"], item["best_mn"]) == (1.5, None)
        went_on = api.finish("run_2")
        assert (went_on["state"], went_on["generations"]) == ("SUCCEEDED", 10)
