"""A backup may come from a stranger: what is put back is exactly what wingfit writes, without its keys."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import create_engine
from typer.testing import CliRunner

from tests.service.conftest import made, toy_service
from wingfit.cli.main import app as commands
from wingfit.client.client import WingfitError
from wingfit.service.auth import keys
from wingfit.service.storage import backup as backups
from wingfit.service.storage import backup_schema
from wingfit.service.storage.backup import BackupError, restore, snapshot
from wingfit.service.storage.backup_contents import BackupOwner
from wingfit.service.storage.backup_schema import SchemaError, _normal, check_schema
from wingfit.service.storage.database import Database, migrate, revisions

HERE = Path(__file__).parent
HOSTILE = "\x1b[2J\x1b]0;owned\x07\u202egnp\n\x9b31m"


def edit(path: Path, *statements: str) -> None:
    with closing(sqlite3.connect(path)) as connection:
        for statement in statements:
            connection.execute(statement)
            connection.commit()


def edit_schema(path: Path, *statements: str) -> None:
    edit(path, "PRAGMA writable_schema=ON", *statements)


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A backup with data of two owners, and the keys of both."""
    folder = tmp_path_factory.mktemp("original") / "source"
    admin = made(folder, "root", "admin")
    made(folder, "ann", "read", "write")
    database = Database(folder)
    with database.write() as session:
        row, _ = keys.make(session, "old", "old", ["read"])
        keys.revoke(session, row.id)
    database.close()
    settings = {"require_keys": True}
    with toy_service(folder, **settings) as (_, api):
        api.client.headers["Authorization"] = f"Bearer {admin}"
        run = api.submit(api.upload()["id"])["id"]
        api.finish(run)
        return snapshot(folder)


@pytest.fixture
def copy(original: Path, tmp_path: Path) -> Path:
    """The backup as a file of its own, which a test may spoil."""
    return Path(shutil.copy2(original, tmp_path / "copy.sqlite3"))


def good_keys(folder: Path) -> list[str]:
    database = Database(folder)
    with database.read() as session:
        found = [row.name for row in keys.every(session) if row.revoked_at is None]
    database.close()
    return sorted(found)


def test_keys_are_revoked_unless_they_are_to_stay(copy: Path, tmp_path: Path) -> None:
    brought = restore(copy, tmp_path / "new")
    assert [(key.name, key.owner, key.scopes) for key in brought.keys] == [
        ("root", "root", ("admin",)),
        ("ann", "ann", ("read", "write")),
    ]
    assert brought.owners == (BackupOwner("root", 1, 1, 0, 0, 0),)
    assert good_keys(tmp_path / "new") == []
    assert restore(copy, tmp_path / "same", keep_keys=True) == brought
    assert good_keys(tmp_path / "same") == ["ann", "root"]
    database = Database(tmp_path / "new")
    with database.read() as session:
        assert all(row.revoked_at and row.revoked_at >= row.created_at for row in keys.every(session))
    database.close()


def test_the_command_lists_what_a_backup_brings(copy: Path, tmp_path: Path) -> None:
    done = CliRunner().invoke(commands, ["restore", str(copy), "--data", str(tmp_path / "new")])
    assert done.exit_code == 0, done.output
    listed = " ".join(done.stdout.split())
    assert "valid API keys in the backup: id name owner scopes created key_" in listed
    assert "root root admin 20" in listed
    assert "ann ann read, write 20" in listed
    assert " old " not in listed
    assert "owner datasets runs diagnoses films trackings root 1 1 0 0 0" in listed
    said = " ".join(done.stderr.split())
    assert "2 API keys of the backup are revoked" in said
    assert "--keep-keys" in said
    assert "wingfit keys create NAME --scope admin --data" in said
    kept = CliRunner().invoke(commands, ["restore", str(copy), "--data", str(tmp_path / "same"), "--keep-keys"])
    assert "2 API keys of the backup are valid in" in " ".join(kept.stderr.split())
    assert good_keys(tmp_path / "same") == ["ann", "root"]


def test_a_backup_without_keys_and_data_says_so(tmp_path: Path) -> None:
    Database(tmp_path / "source").close()
    empty = snapshot(tmp_path / "source")
    done = CliRunner().invoke(commands, ["restore", str(empty), "--data", str(tmp_path / "new")])
    assert "none: there is no data" in done.stdout
    assert "has no valid API key" in done.stderr


def test_names_in_a_backup_do_not_steer_a_terminal(copy: Path, tmp_path: Path) -> None:
    with closing(sqlite3.connect(copy)) as connection:
        connection.execute("update key set name = ?, owner = ?, id = 'key_' || ? || number", [HOSTILE] * 3)
        connection.execute("update key set created_at = ?", [HOSTILE])
        connection.execute("update dataset set owner = ?", [HOSTILE])
        connection.execute(
            "update run set owner = ?", [HOSTILE + "\ud83d".encode("utf-8", "surrogatepass").decode("utf-8", "replace")]
        )
        connection.commit()
    done = CliRunner().invoke(commands, ["restore", str(copy), "--data", str(tmp_path / "new")])
    assert done.exit_code == 0, done.output
    assert not set("\x1b\x07\x9b\u202e") & set(done.output)
    assert "owned" in done.stdout


# What a stranger may put into a database, each run on a good copy.
FOREIGN = {
    "trigger": "create trigger t after insert on run begin delete from dataset; end",
    "view": "create view v as select * from run",
    "virtual table": "create virtual table v using fts5(x)",
    "table": "create table more (x)",
    "index": "create index more on run (name)",
    "unique index": "create unique index more on run (dataset_id)",
    "column": "alter table run add column more",
    "default": "alter table dataset add column more default 'x'",
    "generated column": "alter table dataset add column more as (zeroblob(1000000000))",
    "lost table": "drop table step",
    "lost index": "drop index ix_run_state",
    "other column": "alter table answer rename column body to more",
    "statistics": "analyze",
    "name that steers": 'create table "\x1b[2Jx" (x)',
}


@pytest.mark.parametrize("statement", FOREIGN.values(), ids=FOREIGN.keys())
def test_a_schema_that_is_not_ours_is_refused(copy: Path, tmp_path: Path, statement: str) -> None:
    edit(copy, statement)
    refuse(copy, tmp_path / "new")


WRITTEN = {
    "check": "update sqlite_master set sql = replace(sql, 'name VARCHAR', 'name VARCHAR CHECK (1)') where name = 'run'",
    "trigger as a table": (
        "insert into sqlite_master values ('table', 't', 'run', 0, "
        "'create trigger t after insert on run begin delete from dataset; end')"
    ),
    "type of a column": "update sqlite_master set sql = replace(sql, 'id VARCHAR', 'id TEXT') where name = 'run'",
    "cascade": "update sqlite_master set sql = replace(sql, 'RESTRICT', 'CASCADE') where name = 'run'",
    "bytes": "update sqlite_master set sql = cast(sql as blob) where name = 'run'",
    "type": "update sqlite_master set type = 'TABLE' where name = 'run'",
    "default": "update sqlite_master set sql = replace(sql, '''tracks''', '''TRACKS''') where name = 'run'",
}


@pytest.mark.parametrize("statement", WRITTEN.values(), ids=WRITTEN.keys())
def test_a_schema_that_was_written_by_hand_is_refused(copy: Path, tmp_path: Path, statement: str) -> None:
    before = schema(copy)
    edit_schema(copy, statement)
    assert schema(copy) != before, "the statement changed nothing"
    refuse(copy, tmp_path / "new")


def test_an_object_that_hides_behind_another_is_refused(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whichever of two with one name SQLite goes by; the present one refuses to open such a file by itself."""
    another = "select 'table' as type, 'answer' as name, 'answer' as tbl_name, 'create trigger t' as sql"
    both = " ".join([another, "union all select * from (", backup_schema.OBJECTS, ")"])
    monkeypatch.setattr(backup_schema, "OBJECTS", both)
    with closing(sqlite3.connect(copy)) as connection, pytest.raises(SchemaError, match="twice"):
        check_schema(connection)


def schema(path: Path) -> list[object]:
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("PRAGMA writable_schema=ON")  # else SQLite refuses some by itself
        return connection.execute("select * from sqlite_master").fetchall()


def refuse(copy: Path, folder: Path) -> str:
    with pytest.raises(BackupError) as refused:
        restore(copy, folder)
    assert {path.name for path in folder.iterdir()} <= {"wingfit.lock"}
    said = str(refused.value)
    assert said.isprintable()
    return said


def test_what_is_foreign_is_named(copy: Path, tmp_path: Path) -> None:
    edit(copy, FOREIGN["trigger"])
    assert "it has the trigger 't'" in refuse(copy, tmp_path / "new")
    done = CliRunner().invoke(commands, ["restore", str(copy), "--data", str(tmp_path / "new")])
    assert isinstance(done.exception, WingfitError)


def test_a_view_in_place_of_the_version_is_not_read(copy: Path, tmp_path: Path) -> None:
    edit(copy, "drop table alembic_version", "create view alembic_version as select '0005' as version_num")
    assert "no table alembic_version as wingfit makes it" in refuse(copy, tmp_path / "new")


@pytest.mark.parametrize("version", ["0001", "0004", "9999", "", HOSTILE], ids=ascii)
def test_a_version_that_the_schema_does_not_have_is_refused(copy: Path, tmp_path: Path, version: str) -> None:
    with closing(sqlite3.connect(copy)) as connection:
        connection.execute("update alembic_version set version_num = ?", [version])
        connection.commit()
    said = refuse(copy, tmp_path / "new")
    assert ("newer wingfit" in said) == (version not in revisions())


@pytest.mark.parametrize("count", [0, 2])
def test_one_version_is_stated(copy: Path, tmp_path: Path, count: int) -> None:
    edit(copy, "delete from alembic_version" if count == 0 else "insert into alembic_version values ('0001')")
    assert f"states {count} versions" in refuse(copy, tmp_path / "new")


@pytest.mark.parametrize("revision", revisions())
def test_a_real_backup_of_every_version_is_put_back(tmp_path: Path, revision: str) -> None:
    old = tmp_path / "old.sqlite3"
    engine = create_engine(f"sqlite:///{old}")
    migrate(engine, "0001")
    engine.dispose()
    with closing(sqlite3.connect(old)) as connection:
        connection.executescript((HERE / "first_release.sql").read_text())
        connection.commit()
    engine = create_engine(f"sqlite:///{old}")
    migrate(engine, revision)
    engine.dispose()
    brought = restore(old, tmp_path / "new")
    assert (brought.keys, brought.owners) == ((), (BackupOwner(None, 1, 2, 0, 0, 0),))
    with toy_service(tmp_path / "new") as (_, api):
        assert api.finish("run_2")["state"] == "SUCCEEDED"


def test_how_a_table_was_written_down_does_not_matter(copy: Path, tmp_path: Path) -> None:
    """Operations in batches make a table under another name, and write names in quotes."""
    edit_schema(
        copy,
        "update sqlite_master set sql = replace(sql, 'CREATE TABLE run', 'CREATE TABLE \"run\"') where name = 'run'",
        "update sqlite_master set sql = replace(replace(sql, char(10), ' '), char(9), '  ') where type = 'table'",
    )
    restore(copy, tmp_path / "new")
    assert _normal("create TABLE [run] (`x` INT,\n\t y)") == _normal('CREATE TABLE "run"(x int, "y" )')
    for one, other in (("x DEFAULT 'a'", "x DEFAULT 'A'"), ("x -- y", "x y"), ("x\u00a0y", "x y"), ('"x y"', "x y")):
        assert _normal(one) != _normal(other)


BAD_KEYS = {
    "scopes": "update key set scopes = '[\"root\"]'",
    "scopes that are none": "update key set scopes = '5'",
    "scopes without end": "update key set scopes = '" + "[" * 100_000 + "'",
    "no JSON": "update key set scopes = 'admin'",
    "bytes": "update key set owner = x'00ff'",
    "hash": "update key set sha256 = 'x' || number",
    "time": "update key set revoked_at = x'00'",
}


@pytest.mark.parametrize("statement", BAD_KEYS.values(), ids=BAD_KEYS.keys())
def test_keys_that_wingfit_did_not_make_are_refused(copy: Path, tmp_path: Path, statement: str) -> None:
    edit(copy, statement)
    assert "is none that wingfit made" in refuse(copy, tmp_path / "new")


BAD_ROWS = {
    "run spec": ("run", "update run set spec = 'no JSON'"),
    "run spec without end": ("run", "update run set spec = '" + "[" * 100_000 + "'"),
    "run spec that is a number": ("run", "update run set spec = 5"),
    "run spec of something else": ("run", "update run set spec = '{\"fitness\": 3}'"),
    "run state": ("run", "update run set state = 'DREAMING'"),
    "run wish": ("run", "update run set wish = 'fame'"),
    "run times": ("run", "update run set created_at = x'ff'"),
    "run genome": ("run", "update run set genome = '['"),
    "run starts": ("run", "update run set starts = 'abc'"),
    "run generations": ("run", "update run set generations = x'01'"),
    "run name that is no text": ("run", "update run set name = cast(x'ff' as text)"),
    "dataset recordings": ("dataset", "update dataset set recordings = '[7]'"),
    "dataset kind": ("dataset", "update dataset set kind = 'poems'"),
}


@pytest.mark.parametrize(("table", "statement"), BAD_ROWS.values(), ids=BAD_ROWS.keys())
def test_rows_that_the_server_cannot_read_are_refused(copy: Path, tmp_path: Path, table: str, statement: str) -> None:
    edit(copy, statement)
    assert f"row 1 of its table '{table}' cannot be read" in refuse(copy, tmp_path / "new")
    edit(copy, "delete from run", "delete from dataset")
    restore(copy, tmp_path / "new")  # what was refused does not stand in the way


def test_a_clock_that_stands_at_no_number_is_refused(copy: Path, tmp_path: Path) -> None:
    edit(copy, "delete from clock", "insert into clock values (1, 'abc', '2026-01-01T00:00:00Z')")
    assert "the clock in it stands at 'abc'" in refuse(copy, tmp_path / "new")


def test_a_restore_that_is_killed_leaves_no_database_that_was_not_checked(
    copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dies(_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(backups, "check_rows", dies)
        with pytest.raises(KeyboardInterrupt):
            restore(copy, tmp_path / "new")
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["wingfit.lock"]
    (tmp_path / "new" / "restore-left").mkdir()  # by kill -9
    restore(copy, tmp_path / "new")
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["wingfit.lock", "wingfit.sqlite3"]


BROKEN = ["spec = 'x'", "starts = 'abc'", "created_at = x'41'", "name = cast(x'ff' as text)", "wish = 'fame'"]


@pytest.mark.parametrize("broken", BROKEN)
def test_a_server_starts_though_a_waiting_job_cannot_be_read(
    broken: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with toy_service(tmp_path / "data") as (_, api):
        first, second = (api.submit(api.upload()["id"])["id"] for _ in range(2))
        for run in (first, second):
            api.finish(run)
    edit(
        tmp_path / "data" / "wingfit.sqlite3",
        "update run set state = 'QUEUED'",
        f"update run set {broken} where number = 1",  # noqa: S608
    )
    with toy_service(tmp_path / "data") as (_, api):
        assert api.finish(second)["state"] == "SUCCEEDED"
    assert "row 1 of RunRow cannot be read and is left alone" in caplog.text


def test_a_backup_is_opened_without_trust(copy: Path) -> None:
    with backups._opened(copy, copy) as opened:
        assert [opened.execute(f"PRAGMA {name}").fetchone()[0] for name in ("trusted_schema", "cell_size_check")] == [
            0,
            1,
        ]
        with pytest.raises(sqlite3.OperationalError, match="readonly"):
            opened.execute("delete from answer")


def test_a_restore_that_dies_before_the_keys_are_revoked_leaves_no_database(
    copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dies(_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(backups, "revoke_keys", dies)
        with pytest.raises(KeyboardInterrupt):
            restore(copy, tmp_path / "new")
    assert not list((tmp_path / "new").glob("wingfit.sqlite3*"))
    (tmp_path / "new" / "wingfit.part").write_text("left by kill -9")
    restore(copy, tmp_path / "new")
    assert good_keys(tmp_path / "new") == []
