"""``wingfit cameras wand``, in this process, on simulated points of a wand, of which the cameras are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.cameras.calibrate.simulated import SIZE, parameter_errors, ring, wand_tracks
from tests.command_line import in_process
from wingfit.cameras.calibrate.wand import Wand
from wingfit.cameras.camera import Camera
from wingfit.cameras.files.camera_set import CameraSet
from wingfit.cameras.files.project import write_cameras
from wingfit.cameras.files.read import read_cameras
from wingfit.cameras.files.wand_points import camera_names, read_wand_points
from wingfit.cli.main import app
from wingfit.records.array_types import Array
from wingfit.records.errors import DatasetError

wingfit = in_process(app)
TRUE = ring((0.0, 40.0, 80.0))
PINHOLES = ring((0.0, 40.0, 80.0), "pinhole")
SIZES = ["--size-px", f"{SIZE[0]}x{SIZE[1]}"]
FRAMES = 120


@pytest.fixture(autouse=True)
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def table(tracks: dict[str, Array]) -> str:
    """The table of wingfit, in an order of its own; rows without any marker are left out."""
    markers = next(iter(tracks.values())).shape[1]
    head = ["camera", "frame", *(f"{axis}{k}_px" for k in range(1, markers + 1) for axis in "xy")]
    rows = [",".join(head)]
    for camera, track in tracks.items():
        for frame in range(len(track)):
            cells = ["" if np.isnan(one) else f"{one:.4f}" for one in track[frame].ravel()]
            if any(cells):
                rows.append(",".join([camera, str(frame), *cells]))
    return "\n".join(rows) + "\n"


def dltdv(tracks: dict[str, Array], *, upwards: bool) -> str:
    """The table of DLTdv: cameras within points, pixels from 1."""
    head, columns = [], []
    for point in (0, 1):
        for number, track in enumerate(tracks.values(), 1):
            x, y = track[:, point].T
            columns += [x + 1, SIZE[1] - y if upwards else y + 1]
            head += [f"pt{point + 1}_cam{number}_{axis}" for axis in "XY"]
    rows = [",".join("NaN" if np.isnan(one) else f"{one:.4f}" for one in row) for row in zip(*columns, strict=True)]
    return "\n".join([",".join(head), *rows]) + "\n"


def worst(found: tuple[Camera, ...], true: tuple[Camera, ...], covariance: Array | None) -> float:
    """The largest error of a parameter that was estimated, in its standard errors."""
    assert covariance is not None
    deviation = np.sqrt(np.diag(covariance))
    free = deviation > 0
    assert free.sum() >= 6 * (len(true) - 1)
    return float(np.abs(parameter_errors(found, true)[free] / deviation[free]).max())


def test_poses_and_scale_are_found_with_known_lenses() -> None:
    stick = Wand((0.24,))
    Path("wand.csv").write_text(table(wand_tracks(TRUE, stick.shape, FRAMES, np.random.default_rng(1))))
    write_cameras(Path("lenses.yaml"), CameraSet(TRUE))
    words = ["wand.csv", "--length-mm", "240", "--lenses", "lenses.yaml", "-o", "out.yaml", "--report", "wand.html"]
    code, out, err = wingfit("cameras", "wand", *words)
    assert code == 0, err
    assert "camera a: 0.2" in out
    assert "length of the wand: RMS error 0." in out
    assert "cameras written to out.yaml" in err
    assert "Lengths of the wand" in Path("wand.html").read_text()
    found = read_cameras(Path("out.yaml"))
    assert worst(found.cameras, TRUE, found.covariance) < 4.5
    for one, true in zip(found.cameras, TRUE, strict=True):
        assert one.centre == pytest.approx(true.centre, abs=1e-3)
        assert one.lens == true.lens
    # The scale: distances of the cameras.
    apart = [np.linalg.norm(of[2].centre - of[0].centre) for of in (found.cameras, TRUE)]
    assert apart[0] / apart[1] == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("upwards", [True, False])
def test_the_pixels_of_dltdv_give_focal_lengths_too(*, upwards: bool) -> None:
    stick = Wand((0.24,))
    tracks = wand_tracks(PINHOLES, stick.shape, FRAMES, np.random.default_rng(2))
    Path("xypts.csv").write_text(dltdv(tracks, upwards=upwards))
    origin = ["--origin", "lower-left" if upwards else "upper-left"]
    words = ["cameras", "wand", "xypts.csv", "--length-mm", "240", *SIZES, "--focal-px", "1150"]
    code, out, err = wingfit(*words, *origin)
    assert code == 0, err
    assert "camera cam3: 0." in out
    found = read_cameras(Path("cameras.yaml"))
    for one, true in zip(found.cameras, PINHOLES, strict=True):
        # Of the principal points, 3 to 9 px from the middle, nothing is estimated.
        assert one.matrix[0, 0] == pytest.approx(true.matrix[0, 0], rel=0.02)
        assert np.linalg.norm(one.centre - true.centre) < 0.02
    code, _, err = wingfit(*words)
    assert (code, "give the origin: lower-left" in err) == (1, True)


def test_a_wand_with_three_markers_is_read() -> None:
    stick = Wand((0.1, 0.14, 0.24))
    Path("wand.csv").write_text(table(wand_tracks(TRUE, stick.shape, 60, np.random.default_rng(3))))
    write_cameras(Path("lenses.yaml"), CameraSet(TRUE))
    lengths = [word for one in (100, 140, 240) for word in ("--length-mm", one)]
    code, _, err = wingfit("cameras", "wand", "wand.csv", *lengths, "--lenses", "lenses.yaml")
    assert code == 0, err
    found = read_cameras(Path("cameras.yaml"))
    assert worst(found.cameras, TRUE, found.covariance) < 4.5
    code, _, err = wingfit("cameras", "wand", "wand.csv", *lengths[:2], "--lenses", "lenses.yaml")
    assert (code, "column 'x3_px' belongs to no marker of a wand with 2" in err) == (1, True)


def test_a_table_is_read_back() -> None:
    tracks = wand_tracks(TRUE, Wand((0.24,)).shape, 30, np.random.default_rng(4))
    tracks["a"][7], tracks["b"][9, 1], tracks["a"][29] = np.nan, np.nan, np.nan
    raw = table(tracks).encode()
    assert camera_names(raw, "wand.csv") == ("a", "b", "c")
    for found in (
        read_wand_points(raw, "wand.csv", 2, [SIZE] * 3),
        dict(
            zip(
                "abc",
                read_wand_points(dltdv(tracks, upwards=True).encode(), "x.csv", 2, [SIZE] * 3, "lower-left").values(),
                strict=True,
            )
        ),
    ):
        assert [*found] == ["a", "b", "c"]
        for camera, track in tracks.items():
            np.testing.assert_allclose(found[camera], track, atol=1e-4)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("camera,frame,x1_px,y1_px,x2_px\na,0,1,2,3\n", ["line 1", "there is no column 'y2_px'"]),
        ("camera,frame,x1_px,y1_px,x2_px,y2_px\na,0.5,1,2,3,4\n", ["row 1", "frame 0.5 is no whole number"]),
        ("camera,frame,x1_px,y1_px,x2_px,y2_px\na,300000,1,2,3,4\n", ["frame 300000", "199999"]),
        ("camera,frame,x1_px,y1_px,x2_px,y2_px\na,3,1,2,3,4\na,3,1,2,3,4\n", ["row 2", "frame 3 of camera 'a'"]),
        ("camera,frame,x1_px,y1_px,x2_px,y2_px\na,3,1,2,left,4\n", ["row 1, column 'x2_px'", "'left'"]),
        ("pt1_cam1_X,pt1_cam1_Y\n3,4\n", ["the points are pt1", "has pt1 to pt2"]),
        ("pt1_cam1_X,pt1_cam1_Y,pt2_cam1_X\n3,4,5\n", ["there is no column 'pt2_cam1_y'"]),
    ],
)  # fmt: skip
def test_tables_that_are_wrong_are_refused(text: str, words: list[str]) -> None:
    origin = "lower-left" if text.startswith("pt") else None
    with pytest.raises(DatasetError) as refused:
        read_wand_points(text.encode(), "wand.csv", 2, [SIZE], origin)  # type: ignore[arg-type]
    assert all(word in str(refused.value) for word in words), str(refused.value)


def test_options_that_do_not_suit_are_explained() -> None:
    tracks = wand_tracks(PINHOLES, Wand((0.24,)).shape, 30, np.random.default_rng(4))
    Path("wand.csv").write_text(table(tracks))
    write_cameras(Path("two.yaml"), CameraSet(PINHOLES[:2]))
    words = ["cameras", "wand", "wand.csv", "--length-mm", "240"]
    assert wingfit(*words)[0] == 2
    assert wingfit(*words, "--focal-px", "1100")[0] == 2
    assert wingfit(*words, *SIZES, "--lenses", "two.yaml")[0] == 2
    for more, message in (
        (["--lenses", "two.yaml"], "has no camera 'c', which the points of the wand have"),
        ([*SIZES, "--focal-px", "24"], "24 px; it must be 307.2 to 102400 px"),
        ([*SIZES, "--focal-px", "1100", "--focal-px", "1200"], "2 focal lengths for 3 cameras"),
        ([*SIZES, "--focal-px", "1100", "--free", "focal"], "has no parameter 'focal'"),
        ([*SIZES, "--focal-px", "1100", "--origin", "lower-left"], "origin 'lower-left' is for files of DLTdv"),
    ):
        code, _, err = wingfit(*words, *more)
        assert (code, message in err) == (1, True), err
    code, _, err = wingfit("cameras", "wand", "wand.csv", "--length-mm", "240000", *SIZES, "--focal-px", "1100")
    assert (code, "240.0 m; it must lie in (0, 10] m" in err) == (1, True), err
