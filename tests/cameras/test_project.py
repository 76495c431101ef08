"""The description of films: what is read, and what is refused with line, value and remedy."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.cameras.films import FILM, NAMES, PLACES, cameras, write_film
from wingfit.cameras.files.camera_set import CameraSet
from wingfit.cameras.files.project import write_cameras
from wingfit.cameras.project import read_film
from wingfit.cameras.track.labels import Label
from wingfit.records.errors import DatasetError


@pytest.fixture
def film(tmp_path: Path) -> Path:
    return write_film(tmp_path, frames=0)


def test_a_description_is_read(film: Path, tmp_path: Path) -> None:
    found = read_film(film, tmp_path / "store")
    assert [camera.name for camera in found.cameras] == ["left", "right"]
    assert [one.path for one in found.films] == [tmp_path / "left", tmp_path / "right"]
    assert {one.rate_hz for one in found.films} == {100.0}
    assert (found.kind, found.light, found.names) == ("dot", "continuous", NAMES)
    assert found.reference == pytest.approx(PLACES, abs=1e-6)
    assert (found.calibration, found.within_s, found.first, found.last, found.labels) == (None, 0.0, 0, None, ())
    assert found.store == tmp_path / "store"


def test_options_are_read(film: Path) -> None:
    options = "clocks_within_ms: 2.5\nfirst_frame: 3\nlast_frame: 9\n"
    film.write_text(FILM.replace("  places: markers.csv\n", "") + options)
    found = read_film(film)
    assert (found.within_s, found.first, found.last) == (0.0025, 3, 9)
    assert (found.names, found.reference, found.store) == ((), None, None)


def test_labels_are_read(film: Path) -> None:
    film.write_text(FILM + "labels: labels.csv\n")
    with pytest.raises(DatasetError, match=r"line 11.*there is no .*labels\.csv"):
        read_film(film)
    (film.parent / "labels.csv").write_text("camera,frame,marker,x_px,y_px\nleft,3,m04,10.5,20\n")
    assert read_film(film).labels == (Label("left", 3, "m04", (10.5, 20.0)),)
    (film.parent / "labels.csv").write_text("camera,frame,marker\n")
    with pytest.raises(DatasetError, match=r"labels\.csv, line 1: the header is"):
        read_film(film)


def test_cameras_without_film_are_left_out_with_their_covariance(film: Path) -> None:
    left, right = cameras()
    three = (left, replace(left, name="middle", translation=left.translation + 0.1), right)
    count = len(left.parameter_names)
    covariance = np.diag(np.repeat([1.0, 2.0, 3.0], count)) * 1e-4
    write_cameras(film.parent / "cameras.yaml", CameraSet(three, covariance))
    found = read_film(film)
    assert [camera.name for camera in found.cameras] == ["left", "right"]
    assert found.calibration == pytest.approx(np.diag(np.repeat([1.0, 3.0], count)) * 1e-4)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("light:", "lihgt:", ["the key 'light' is missing; add it"]),
        ("version: 1", "version: 1\nfame: 3", ["line 3", "unknown key 'fame'; known: format, version"]),
        ("  kind: dot", "  kind: dot\n  kinds: dot", ["line 10", "unknown key 'kinds'", "did you mean 'kind'"]),
        ("wingfit film", "wingfit cameras", ["line 1", "'wingfit cameras 1' is not 'wingfit film' version 1"]),
        ("version: 1", "version: 2", ["'wingfit film 2' is not"]),
        ("path: left,", "path: lefft,", ["line 6", "there is no", "lefft", "paths count from the folder of film.yaml"]),
        ("{path: left, rate_hz: 100}", "left", ["line 6", "is no mapping with the keys path, rate_hz"]),
        ("{path: right,", "{path: left,", ["line 7", "camera 'right' has the film of camera 'left'"]),
        ("path: left,", "path: 7,", ["line 6", "7 is no path; state that of a file or folder"]),
        ("cameras.yaml", "other.yaml", ["line 3", "there is no", "other.yaml"]),
        ("  right: {path: right, rate_hz: 100}\n", "", ["line 5", "1 films", "2 to 8 cameras"]),
        ("  right:", "  rigth:", ["line 7", "unknown key 'rigth'; did you mean 'right'"]),
        ("  right:", "  7:", ["line 7", "unknown key"]),
        ("rate_hz: 100}\n  right", "rate_hz: -3}\n  right", ["line 6", "-3; it must be a number from 0.001 to 1e+06"]),
        ("rate_hz: 100}\n  right", "rate_hz: fast}\n  right", ["line 6", "fast; it must be a number"]),
        ("rate_hz: 100}\n  right", "rate_hz: true}\n  right", ["line 6", "it must be a number"]),
        ("kind: dot", "kind: dots", ["line 9", "'dots'; did you mean 'dot'"]),
        ("continuous", "stroboscope", ["line 4", "'stroboscope'", "strobe"]),
        ("continuous", "[strobe]", ["line 4", "'list of 1'"]),
        ("continuous", "strobe\nclocks_within_ms: 2", ["line 5", "leave the key out"]),
        ("continuous", "continuous\nclocks_within_ms: 2000", ["line 5", "2000; it must be a number from 0 to 1000"]),
        ("continuous", "continuous\nfirst_frame: 2.5", ["line 5", "2.5 is no whole number; frames are counted from 0"]),
        ("continuous", "continuous\nfirst_frame: 9\nlast_frame: 9", ["line 6", "from 10 to", "not included"]),
        ("  kind: dot", "  kind: dot\n  wing: markers.csv", ["line 8", "has both 'wing' and 'places'; keep one"]),
        ("markers.csv", "left", ["left", "cannot be read", "check the path"]),
        ("markers.csv", "m" * 300, ["line 10", "File name too long", "check the path"]),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_refused(film: Path, old: str, new: str, words: list[str]) -> None:
    assert FILM.count(old) == 1
    film.write_text(FILM.replace(old, new))
    with pytest.raises(DatasetError) as refused:
        read_film(film)
    message = str(refused.value)
    assert all(word in message for word in words), message


def table(rows: list[str]) -> str:
    return "\n".join(["marker,x_m,y_m,z_m", *rows]) + "\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            table([f"m{k},{1000 * x:g},{1000 * y:g},{z:g}" for k, (x, y, z) in enumerate(PLACES)]),
            ["the markers extend over", "in metres"],
        ),
        (table([f"m{k},{x / 1e3},{y / 1e3},{z}" for k, (x, y, z) in enumerate(PLACES)]), ["extend over 0.0"]),
        (table([f"m{k // 2},{x},{y},{z}" for k, (x, y, z) in enumerate(PLACES)]), ["two markers have the name 'm0'"]),
        (table([f"m{k},{x},{y},{'' if k == 3 else z}" for k, (x, y, z) in enumerate(PLACES)]), ["'m3' has no place"]),
        (
            table([f"m{k},{x},{y},{z}" for k, (x, y, z) in enumerate((*PLACES, PLACES[3]))]),
            ["the markers 'm3' and 'm12' have one place; give each its own"],
        ),
        (table([f"m{k},{x},{y},{z}" for k, (x, y, z) in enumerate(PLACES[:5])]), ["5 markers; at least 6 are needed"]),
        ("marker,x_m,y_m\nm0,0,0\n", ["z_m"]),
    ],
)  # fmt: skip
def test_places_that_cannot_be_are_refused(film: Path, text: str, words: list[str]) -> None:
    (film.parent / "markers.csv").write_text(text)
    with pytest.raises(DatasetError) as refused:
        read_film(film)
    assert all(word in str(refused.value) for word in words), str(refused.value)


@pytest.mark.parametrize("linked", [False, True])
def test_two_cameras_have_no_copies_of_one_film(film: Path, linked: bool) -> None:
    for number, camera in enumerate(("left", "right")):
        (film.parent / camera / "1.png").write_bytes(b"alike")
        (film.parent / camera / "2.png").write_bytes(b"%d" % number)
    assert len(read_film(film).films) == 2
    right = film.parent / "right" / "2.png"
    right.unlink()
    (right.hardlink_to if linked else right.symlink_to)(film.parent / "left" / "2.png")
    with pytest.raises(DatasetError, match=r"camera 'right' has the film of camera 'left', or a copy of it"):
        read_film(film)


def test_a_file_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"none\.yaml: cannot be read: .*; check the path"):
        read_film(tmp_path / "none.yaml")
