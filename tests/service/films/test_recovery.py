"""Films after a kill of the server, with the Python client, and in databases of strangers."""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.service.conftest import toy_service
from tests.service.films.films import CAMERAS, FRAMES, MARKERS, ended, processes_of, submitted, uploaded
from tests.service.processes import ServerProcess
from wingfit.cli.main import app as commands
from wingfit.client.client import Client, WingfitError
from wingfit.service.storage import store
from wingfit.service.storage.backup import BackupError, restore, snapshot
from wingfit.service.storage.database import FILE_NAME
from wingfit.service.storage.tables import FilmRow

SERVER = ("tests.service.toy_server", "0.02")
NEVER = "fl_0000000000000000"


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("recovery") / "data"


def detected(data: Path, film: str) -> dict[Path, int]:
    """The stored detections, and when each was written."""
    return {path: path.stat().st_mtime_ns for path in (data / "films" / film / "detected").rglob("*.npz")}


def test_a_tracking_goes_on_after_a_kill_and_gives_the_same_tracks(data: Path, long_film: Path) -> None:
    with ServerProcess(data, SERVER) as first:
        film = uploaded(first.api, long_film)["id"]
        tracking = submitted(first.api, film, last_frame=130)["id"]
        deadline = time.monotonic() + 60
        while not detected(data, film):
            assert time.monotonic() < deadline
            time.sleep(0.02)
        first.kill()
    while processes_of(film):  # its process ends by itself
        assert time.monotonic() < deadline
        time.sleep(0.02)
    before = detected(data, film)
    with ServerProcess(data, SERVER) as second:
        assert second.api.get(f"/v1/trackings/{tracking}")["state"] in ("QUEUED", "RUNNING"), "killed too late"
        assert ended(second.api, tracking, 120.0)["state"] == "SUCCEEDED"
        after = detected(data, film)
        assert {path: after[path] for path in before} == before
        assert len(after) > len(before)
        other = uploaded(second.api, long_film)["id"]
        undisturbed = ended(second.api, submitted(second.api, other, last_frame=130)["id"], 120.0)["id"]
        tracks = [second.client.get(f"/v1/trackings/{one}/tracks.csv").content for one in (tracking, undisturbed)]
        assert tracks[0] == tracks[1]


def test_a_killed_upload_or_deletion_leaves_nothing(tmp_path: Path, folder: Path) -> None:
    """What is renamed for a deletion that was not stored comes back."""
    data = tmp_path / "data"
    with toy_service(data) as (_, api):
        film = uploaded(api, folder)["id"]
    place = data / "films" / film
    (place / "videos" / "left.01234567.part").write_bytes(b"half")
    (data / "films" / f"deleted-{NEVER}").mkdir()
    (data / "films" / "fl_1111111111111111").mkdir()  # of no film: kept, since a database may be an older one
    place.replace(data / "films" / f"deleted-{film}")
    with toy_service(data) as (_, api):
        assert api.get(f"/v1/films/{film}")["ready"]
    assert sorted(one.name for one in (data / "films").iterdir()) == sorted([film, "fl_1111111111111111"])
    assert len(list((place / "videos").iterdir())) == 3


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    data = tmp_path_factory.mktemp("client") / "data"
    with toy_service(data) as (_, api), Client(str(api.client.base_url)) as client:
        yield client


def test_the_client_tracks_a_film(client: Client, folder: Path, tmp_path: Path) -> None:
    film = client.create_film("run 3", CAMERAS, rate_hz={"left": 100.0})
    sent: list[tuple[int, int]] = []
    client.upload_film_file(film["id"], "cameras", folder / "cameras.yaml")
    for camera in CAMERAS:
        path = folder / f"{camera}.avi"
        film = client.upload_film_file(film["id"], camera, path, on_bytes=lambda *pair: sent.append(pair))
        assert sent[-1] == (path.stat().st_size, path.stat().st_size)
    assert film["ready"]
    assert client.films() == [film] == [client.film(film["id"])]
    assert client.film_frame(film["id"], "left", 3, width_px=100)[:2] == b"\xff\xd8"
    assert len(client.film_markers(film["id"], "left", 3, "dot")) == 12
    tracking = client.submit_tracking(film["id"], kind="dot", light="continuous", places=MARKERS, name="mine")
    steps: list[float] = []
    done = client.wait_for_tracking(tracking["id"], lambda job: steps.append(job["progress"]))
    assert (done["state"], done["name"]) == ("SUCCEEDED", "mine")
    assert (steps[0], steps[-1], steps == sorted(steps)) == (0.0, 1.0, True)
    assert client.tracking(tracking["id"]) == done
    assert client.trackings(film_id=film["id"], state="SUCCEEDED") == [done]
    assert client.tracking_result(tracking["id"])["instants"] == FRAMES
    tracks = client.download_tracks(tracking["id"], tmp_path)
    assert tracks.name == f"{tracking['id']}-tracks.csv"
    assert len(tracks.read_text().splitlines()) == FRAMES + 1
    with np.load(client.download_covariance(tracking["id"], tmp_path / "spread.npz")) as spread:
        assert len(spread["covariance"]) == FRAMES
    assert "12 of 12 markers" in client.tracking_report(tracking["id"])
    assert [event["event"] for event in client.tracking_events(tracking["id"])][-1] == "state"
    with pytest.raises(WingfitError, match="cannot cancel"):
        client.cancel_tracking(tracking["id"])
    client.delete_tracking(tracking["id"])
    client.delete_film(film["id"])
    assert (client.films(), client.trackings()) == ([], [])


def test_the_client_refuses_what_is_no_file(client: Client, tmp_path: Path) -> None:
    with pytest.raises(WingfitError, match="no such file"):
        client.upload_film_file(NEVER, "left", tmp_path / "none.avi")


def test_a_backup_has_films_without_their_files(tmp_path: Path, folder: Path) -> None:
    data = tmp_path / "data"
    with toy_service(data) as (_, api):
        film = uploaded(api, folder)["id"]
        tracking = ended(api, submitted(api, film)["id"])["id"]
        copy = snapshot(data)
        assert copy.stat().st_size < (folder / "left.avi").stat().st_size + 2_000_000
    done = CliRunner().invoke(commands, ["restore", str(copy), "--data", str(tmp_path / "new")])
    assert done.exit_code == 0, done.output
    assert "1 film(s) came without their videos" in " ".join(done.stderr.split())
    with toy_service(tmp_path / "new") as (_, api):
        assert api.get(f"/v1/films/{film}")["missing"] == ["cameras", "left", "right"]
        assert api.get(f"/v1/trackings/{tracking}/result")["instants"] == FRAMES
    (data / "films").replace(tmp_path / "new" / "films")  # as the note says
    with toy_service(tmp_path / "new") as (_, api):
        assert api.get(f"/v1/films/{film}")["ready"]
        assert api.client.get(f"/v1/trackings/{tracking}/tracks.csv").status_code == 200


@pytest.mark.parametrize(
    ("table", "column", "value"),
    [
        ("film", "id", "../../elsewhere"),
        ("film", "calibration", "../../../etc/passwd"),
        ("film", "cameras", json.dumps([{"name": "left", "file": "../../wingfit.sqlite3", "stated_rate_hz": None}])),
        ("film", "cameras", json.dumps({"name": "left"})),
        ("tracking", "id", "tk_../x"),
        ("tracking", "spec", json.dumps({"kind": "dot"})),
        ("tracking", "state", "ENDLESS"),
    ],
)
def test_a_backup_whose_names_lead_elsewhere_is_refused(
    stolen: Path, tmp_path: Path, table: str, column: str, value: str
) -> None:
    copy = tmp_path / "copy.sqlite3"
    copy.write_bytes(stolen.read_bytes())
    with closing(sqlite3.connect(copy)) as connection:
        connection.execute(f"update {table} set {column} = ?", [value])  # noqa: S608  # words of this test
        connection.commit()
    with pytest.raises(BackupError, match=f"row 1 of its table '{table}' cannot be read"):
        restore(copy, tmp_path / "new")
    assert not (tmp_path / "new" / FILE_NAME).exists()


@pytest.fixture(scope="module")
def stolen(tmp_path_factory: pytest.TempPathFactory, folder: Path) -> Path:
    """A backup with a film and a tracking."""
    data = tmp_path_factory.mktemp("stolen") / "data"
    with toy_service(data) as (_, api):
        submitted(api, uploaded(api, folder)["id"])
        return snapshot(data)


def test_trackings_end_with_their_time(tmp_path: Path, folder: Path) -> None:
    """Retention removes the files of trackings, and leaves films."""
    data = tmp_path / "data"
    with toy_service(data, keep_days=1) as (service, api):
        film = uploaded(api, folder)["id"]
        tracking = ended(api, submitted(api, film)["id"])["id"]
        service._housekeeping.tidy()
        with service.database.write() as session:
            session.connection().exec_driver_sql("update clock set service_seconds = service_seconds + 2 * 86400")
        assert service._housekeeping.tidy() == 1
        assert api.client.get(f"/v1/trackings/{tracking}").status_code == 404
        assert not (data / "films" / film / "tracked" / tracking).exists()
        with service.database.read() as session:
            assert store.one(session, FilmRow, film).id == film
    assert (data / "films" / film / "videos").is_dir()
