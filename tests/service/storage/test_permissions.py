"""What is stored can be read by its owner alone, whatever the umask; what others own is left as it is."""

from __future__ import annotations

import errno
import logging
import os
import shutil
import sqlite3
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.service.conftest import toy_service
from wingfit.cli.main import app as commands
from wingfit.client.client import Client
from wingfit.service.storage import backup as backups
from wingfit.service.storage.backup import restore, snapshot
from wingfit.service.storage.database import FILE_NAME, LOCK_NAME, Database

UMASKS = [0o000, 0o022, 0o077, 0o777]


@contextmanager
def umask(mask: int) -> Iterator[None]:
    before = os.umask(mask)
    try:
        yield
    finally:
        os.umask(before)


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def modes(folder: Path) -> dict[str, int]:
    return {path.name: mode(path) for path in folder.iterdir()}


def write(database: Database) -> None:
    with database.write() as session:
        session.connection().exec_driver_sql("insert into answer values ('p', 'k', 'f', 200, 'l', '{}', 't')")


@pytest.mark.parametrize("mask", UMASKS)
def test_a_new_folder_and_all_in_it_are_the_owners_alone(tmp_path: Path, mask: int) -> None:
    folder = tmp_path / "data"
    with umask(mask):
        database = Database(folder)
        write(database)
        copy = snapshot(folder)
        assert mode(folder) == 0o700
        assert set(modes(folder).values()) == {0o600}
        assert {FILE_NAME, f"{FILE_NAME}-wal", f"{FILE_NAME}-shm", LOCK_NAME, copy.name} == set(modes(folder))
        database.close()
        again = tmp_path / "again"
        restore(copy, again)
        assert mode(again) == 0o700
        assert set(modes(again).values()) == {0o600}


def test_parents_of_a_new_folder_are_as_the_umask_has_them(tmp_path: Path) -> None:
    with umask(0o022):
        Database(tmp_path / "parent" / "data").close()
    assert (mode(tmp_path / "parent"), mode(tmp_path / "parent" / "data")) == (0o755, 0o700)


@pytest.mark.parametrize("holding", [None, FILE_NAME, LOCK_NAME])
def test_what_earlier_versions_left_open_is_closed_and_logged(
    tmp_path: Path, holding: str | None, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "data"
    folder.mkdir()
    if holding:
        (folder / holding).touch()
        (folder / "notes.txt").touch()
        (folder / holding).chmod(0o664)
    folder.chmod(0o775)
    caplog.set_level(logging.INFO, "wingfit")
    database = Database(folder)
    assert (mode(folder), mode(folder / FILE_NAME)) == (0o700, 0o600)
    assert f"{folder} was open to other users (mode 0775); now it is not (0700)" in caplog.text
    assert (f"{FILE_NAME} was open to other users (mode 0664)" in caplog.text) == (holding == FILE_NAME)
    database.close()


def test_a_log_that_was_left_open_is_closed(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    database = Database(folder)
    write(database)
    left = tmp_path / "killed"
    shutil.copytree(folder, left)  # as a server leaves it that is killed
    database.close()
    for path in left.iterdir():
        path.chmod(0o644)
    database = Database(left)
    assert {name: bits for name, bits in modes(left).items() if name != LOCK_NAME and bits != 0o600} == {}
    with database.look() as connection:
        assert connection.execute("select key from answer").fetchone() == ("k",)
    database.close()


def test_a_folder_that_serves_others_too_is_left_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "home"
    folder.mkdir()
    (folder / "letter.txt").touch()
    folder.chmod(0o755)
    Database(folder).close()
    assert (mode(folder), mode(folder / FILE_NAME)) == (0o755, 0o600)
    (warning,) = [record for record in caplog.records if record.levelno == logging.WARNING]
    assert "stays open to other users (mode 0755): it holds other files" in warning.getMessage()
    assert f"chmod go-rwx {folder}" in warning.getMessage()


def test_a_volume_of_somebody_elses_is_left_with_a_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """As Kubernetes mounts one with fsGroup: of root, writable for the group."""
    folder = tmp_path / "volume"
    folder.mkdir()
    folder.chmod(0o2775)
    monkeypatch.setattr(os, "geteuid", lambda: folder.stat().st_uid + 1)
    Database(folder).close()
    assert mode(folder) == 0o2775
    assert f"{folder} stays open to other users (mode 2775): it belongs to user" in caplog.text


def test_a_file_system_without_rights_is_left_with_a_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "share"
    folder.mkdir(0o777)
    folder.chmod(0o777)

    def refused(*_: object, **__: object) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(Path, "chmod", refused)
    Database(folder).close()
    assert "stays open to other users (mode 0777): Operation not permitted" in caplog.text


def test_a_backup_is_the_owners_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data, there = tmp_path / "data", tmp_path / "there"
    there.mkdir()
    (there / "old").touch()
    with umask(0), toy_service(data) as (_, api), Client(str(api.client.base_url)) as client:
        dataset = api.upload()["id"]
        assert mode(client.backup(there / "wings.sqlite3")) == 0o600
        (there / "old.part").touch()  # left by another one that was killed
        assert mode(client.backup(there / "old")) == 0o600
        assert mode(client.download(dataset, there / "set.zip")) == 0o666  # what was uploaded is no secret of ours
    with umask(0):
        assert CliRunner().invoke(commands, ["backup", str(there / "off"), "--data", str(data)]).exit_code == 0
        assert mode(there / "off") == 0o600
        monkeypatch.setattr(Path, "replace", _across(Path.replace))
        assert CliRunner().invoke(commands, ["backup", str(there / "far"), "--data", str(data)]).exit_code == 0
    assert mode(there / "far") == 0o600
    backups.check(there / "far")
    assert not list(data.glob("copy-*"))


def _across(replace: Callable[[Path, Path], Path]) -> Callable[[Path, Path], Path]:
    """Refuse to rename out of the data folder, as between file systems."""

    def refused(self: Path, target: Path) -> Path:
        if self.suffix == backups.SUFFIX:
            raise OSError(errno.EXDEV, "Invalid cross-device link")
        return replace(self, target)

    return refused


def test_sqlite_gives_its_log_the_rights_of_the_database(tmp_path: Path) -> None:
    """What the rest relies on."""
    path = tmp_path / "some.sqlite3"
    path.touch(0o600)
    with umask(0):
        connection = sqlite3.connect(path)
        connection.execute("PRAGMA journal_mode=WAL")
        connection.execute("create table t (x)")
        assert set(modes(tmp_path).values()) == {0o600}
        connection.close()
