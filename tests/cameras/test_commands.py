"""``wingfit track`` and ``wingfit cameras convert``, in this process, on a small film."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.cameras.films import FILM, FRAMES, NAMES, RATE, SIZE, cameras, wing, write_film
from tests.cameras.video.test_late_frames import packets
from tests.command_line import in_process
from wingfit.cameras.files.read import read_cameras
from wingfit.cli.main import app
from wingfit.records.files.number_table import read_table

wingfit = in_process(app)


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_film(tmp_path_factory.mktemp("film"))


@pytest.fixture(autouse=True)
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_film_is_tracked(film: Path) -> None:
    words = ["track", film, "--covariance", "spread.npz", "--report", "pictures.html"]
    code, out, err = wingfit(*words, "-o", "tracks.csv")
    assert code == 0, err
    assert f"{FRAMES} instants over 0.240 s; 12 of 12 markers in the median" in out
    assert "m03          found in 100.0 %, standard deviation 0.0" in out
    assert "camera left: residual 0.0" in out
    assert "next: wingfit align tracks.csv --wing dataset.yaml -o aligned.csv" in err
    table = read_table(Path("tracks.csv").read_bytes(), "tracks.csv")
    assert table.times() == pytest.approx(np.arange(FRAMES) / RATE)
    true = np.stack([wing(number / RATE) for number in range(FRAMES)], axis=1)
    errors = np.stack([table.track(name) for name in NAMES]) - true
    assert np.sqrt((errors**2).sum(2).mean()) < 1e-4
    with np.load("spread.npz") as spread:
        assert list(spread["names"]) == list(NAMES)
        scaled = np.einsum("kti,tkij,ktj->kt", errors, np.linalg.inv(spread["covariance"]), errors)
        assert "by_calibration" not in spread
    assert 0.1 < scaled.mean() / 3 < 1.5
    page = Path("pictures.html").read_text()
    assert "12 of 12 markers in the median" in page


def test_the_result_is_printed_as_json(film: Path) -> None:
    short = film.parent / "short.yaml"
    short.write_text(FILM + "last_frame: 8\n")
    code, out, err = wingfit("track", short, "--json")
    assert code == 0, err
    found = json.loads(out)
    assert found["instants"] == 8
    assert list(found["markers"]) == list(NAMES)
    assert {one["found_percent"] for one in found["markers"].values()} == {100.0}
    assert set(found["cameras"]) == {"left", "right"}
    assert found["cameras"]["left"]["bad_frames"] == []
    assert wingfit("track", short)[2].count("nothing was written; to write the tracks, add: --output FILE.csv") == 1


def test_markers_without_known_places_get_names(film: Path) -> None:
    """Their tracks are those of the wing, in an order of their own; clocks that agree are found to."""
    text = FILM.replace("  places: markers.csv\n", "") + "clocks_within_ms: 10\nlast_frame: 20\n"
    other = film.parent / "unnamed.yaml"
    other.write_text(text)
    code, out, err = wingfit("track", other, "-o", "tracks.csv")
    assert code == 0, err
    assert "t12 " in out
    offset = float(err.split("the clock of right is ")[1].split(" ms")[0])
    assert abs(offset) < 0.3
    table = read_table(Path("tracks.csv").read_bytes(), "tracks.csv")
    found = np.stack([table.track(f"t{k:02d}")[10] for k in range(1, 13)])
    time = table.times()[10]
    apart = np.linalg.norm(found[:, None] - wing(time)[None], axis=2)
    assert sorted(apart.argmin(1)) == list(range(12))
    assert apart.min(1).max() < 5e-4


def video(film: Path) -> Path:
    """The right camera's images as a video."""
    path = film.parent / "right.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), RATE, SIZE)
    for number in range(FRAMES):
        image = cv2.imread(str(film.parent / "right" / f"{number}.png"))
        assert image is not None
        writer.write(image)
    writer.release()
    return path


def test_a_film_that_was_cut_off_is_remarked(film: Path) -> None:
    """The remark of ``wingfit track``; the right camera's images are a video that ends early."""
    path = video(film)
    raw = path.read_bytes()
    path.write_bytes(raw[: int(0.75 * len(raw))])
    other = film.parent / "cut.yaml"
    other.write_text(FILM.replace("path: right,", "path: right.avi,"))
    code, out, err = wingfit("track", other)
    assert code == 0, err
    instants = int(out.split(" instants")[0])
    assert FRAMES // 2 < instants < FRAMES - 3
    assert f"the film of right ends at frame {instants}, of {FRAMES} that its container states" in err


def test_a_damaged_frame_moves_none_of_those_behind_it(film: Path) -> None:
    path = video(film)
    packet = packets(path)[18]
    path.write_bytes(path.read_bytes().replace(packet, bytes(len(packet))))
    other = film.parent / "damaged.yaml"
    other.write_text(FILM.replace("path: right,", "path: right.avi,"))
    code, _, err = wingfit("track", other, "-o", "tracks.csv")
    assert code == 0, err
    assert "remark: 1 frame of camera right could not be decoded: 18" in err
    table = read_table(Path("tracks.csv").read_bytes(), "tracks.csv")
    assert table.times()[-1] == pytest.approx((FRAMES - 1) / RATE)
    found = np.stack([table.track(name)[-1] for name in NAMES])
    assert found == pytest.approx(wing((FRAMES - 1) / RATE), abs=5e-4)


def test_what_cannot_be_tracked_is_explained(film: Path) -> None:
    other = film.parent / "wrong.yaml"
    other.write_text(FILM.replace("kind: dot", "kind: dots"))
    code, _, err = wingfit("track", other)
    assert (code, "'dots'; did you mean 'dot'" in err) == (1, True)
    other.write_text(FILM.replace("kind: dot", "kind: chequer") + "last_frame: 4\n")
    code, _, err = wingfit("track", other)
    assert (code, "at least 6 are needed: check kind and light" in err) == (1, True)
    other.write_text(FILM.replace("continuous", "strobe"))
    code, _, err = wingfit("track", other)
    assert (code, "a strobe" in err or "markers in a frame" in err) == (1, True), err
    assert wingfit("track", film, "-o", "tracks.txt")[0] == 2
    Path("detected").write_text("a file")
    assert wingfit("track", film, "--store", "detected")[0] == 2


def test_films_that_do_not_fit_their_cameras_are_refused(film: Path) -> None:
    stated = (film.parent / "cameras.yaml").read_text()
    other = film.parent / "other.yaml"
    other.write_text(FILM.replace("cameras.yaml", "others.yaml"))
    for old, new, words in (
        ("size_px: [320, 240]", "size_px: [640, 480]", "films 320 x 240 px and was calibrated at 640 x 480 px"),
        (
            "row_us: 0.0",
            "row_us: 60",
            "row_us 60 in the file of cameras makes 14.4 ms for 240 rows, more than a fr",
        ),
    ):
        (film.parent / "others.yaml").write_text(stated.replace(old, new, 1))
        code, _, err = wingfit("track", other)
        assert (code, f"camera left: {words}" in err) == (1, True), err
    other.write_text(FILM + "first_frame: 25\n")
    code, _, err = wingfit("track", other)
    assert (code, "the film has 25 frames, counted from 0; begin before its end" in err) == (1, True), err


def test_films_of_different_lengths_are_remarked(film: Path) -> None:
    other = film.parent / "slow.yaml"
    other.write_text(FILM.replace("right, rate_hz: 100", "right, rate_hz: 80"))
    code, _, err = wingfit("track", other)
    assert code == 0, err
    assert "do not last equally long: left 0.25 s, right 0.3125 s; what all cameras filmed is tracked" in err


def test_what_cannot_be_written_is_named(film: Path) -> None:
    short = film.parent / "short.yaml"
    short.write_text(FILM + "last_frame: 8\n")
    Path("full.npz").symlink_to("/dev/full")
    code, _, err = wingfit("track", short, "--covariance", "full.npz")
    assert (code, "cannot write full.npz: No space left on device" in err) == (1, True), err
    Path("detected").write_text("a file")
    code, _, err = wingfit("track", short, "--store", "detected/within")
    assert (code, "cannot be written (Not a directory): free the disk, or choose" in err) == (1, True), err


def test_images_of_one_camera_are_not_those_of_another() -> None:
    for folder, content in (("a", b"one"), ("b", b"other"), ("copy", b"one")):
        Path(folder).mkdir()
        (Path(folder) / "1.png").write_bytes(content)
    Path("hidden").mkdir()
    Path("hidden/._1.png").write_bytes(b"beside an image")
    for words, expected in (
        (["left=a", "left=b"], "camera 'left' is given twice"),
        (["left=a", "right=copy"], "'right' has the images of 'left', or copies of"),
        (["left=a", "right=hidden"], "hidden holds no images"),
        (["left=a", "right=b"], "this is no image that OpenCV reads"),
    ):
        code, _, err = wingfit("cameras", "boards", *words, "--board", "9x6", "--square-mm", "25")
        assert (code > 0, expected in " ".join(err.replace("│", "").split())) == (True, True), err


def test_cameras_of_another_program_are_converted() -> None:
    rows = []
    for camera in cameras():
        matrix = camera.matrix @ np.column_stack([camera.rotation, camera.translation])
        rows.append((matrix / matrix[2, 3]).ravel()[:11])
    text = "\n".join(",".join(f"{value!r}" for value in row) for row in np.array(rows).T.tolist())
    Path("dlt.csv").write_text(text + "\n")
    size = f"{SIZE[0]}x{SIZE[1]}"
    code, out, err = wingfit(
        "cameras", "convert", "dlt.csv", "--unit", "m", "--size-px", size, "--dlt-origin", "opencv"
    )
    assert code == 0, err
    assert "320 x 240 px, lens pinhole" in out
    assert "camera 1 and camera 2 are 0.454 m apart" in out
    assert "cameras written to cameras.yaml" in err
    found = read_cameras(Path("cameras.yaml")).cameras
    for one, true in zip(found, cameras(), strict=True):
        assert one.matrix == pytest.approx(true.matrix, abs=1e-4)
        assert one.rotation == pytest.approx(true.rotation, abs=1e-6)
        assert one.translation == pytest.approx(true.translation, abs=1e-6)
    code, _, err = wingfit("cameras", "convert", "dlt.csv")
    assert code == 1
    assert "unit of length" in err
    assert wingfit("cameras", "convert", "dlt.csv", "--size-px", "wide")[0] == 2
