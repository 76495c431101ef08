"""A whole dataset from tracks alone: what is found in tracks whose motion is known, and what is asked for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wingfit
from tests.importers.reading import read
from wingfit.checks import examine
from wingfit.importers.start import Conditions, Start, start_dataset
from wingfit.importers.start.frequency import flap_frequency
from wingfit.importers.tracks import ImportedTracks
from wingfit.records import Dataset, DatasetError

HAWKS = Path(__file__).parents[4] / "shared" / "data" / "hawk" / "2024-06-03-TestBilateralMarkers.csv"
AXES = "x aft, y out, z up"
HINGE, FREQUENCY, AMPLITUDE = (0.05, 0.02), 3.3, np.radians(25)
REST = {"in": (0.0, 0.15), "mid": (0.04, 0.3), "tip": (0.02, 0.45)}  # x, and distance from the hinge, m


def wing_table(rate: float = 100.0, seconds: float = 1.2, *, both: bool = False) -> str:
    """Tracks of a rigid wing that flaps, in metres; ``both``: with the other wing, mirrored."""
    lines = []
    for time in np.arange(0, seconds, 1 / rate):
        angle = AMPLITUDE * np.sin(2 * np.pi * FREQUENCY * time + 0.7)
        points = [(x, HINGE[0] + r * np.cos(angle), HINGE[1] + r * np.sin(angle)) for x, r in REST.values()]
        points += [(x, -y, z) for x, y, z in points] if both else []
        lines.append(",".join([f"{time:.4f}", *(f"{value:.6f}" for point in points for value in point)]))
    names = [*REST, *(f"left_{name}" for name in REST)] if both else [*REST]
    return ",".join(["time_s", *(f"{name}_{axis}_m" for name in names for axis in "xyz")]) + "\n" + "\n".join(lines)


def loaded(start: Start, folder: Path) -> Dataset:
    (folder / "recordings").mkdir(parents=True)
    for name, text in start.files.items():
        (folder / name).write_text(text)
    found = wingfit.load_dataset(folder)
    assert isinstance(found, Dataset)
    return found


def test_hinge_frequency_and_amplitude_are_those_of_the_motion(tmp_path: Path) -> None:
    start = start_dataset([read(wing_table(), axes=AXES)], "wing", Conditions())
    dataset = loaded(start, tmp_path / "wing")
    assert start.kind == "wing"
    assert (dataset.wing.hinge.y, dataset.wing.hinge.z) == pytest.approx(HINGE, abs=2e-4)
    assert dataset.recordings[0].condition.flap_frequency == pytest.approx(FREQUENCY, rel=0.01)
    drive = dataset.wing.drive
    assert isinstance(drive, wingfit.records.FourierDrive)
    assert drive.sine[0] == pytest.approx(AMPLITUDE, rel=0.02)
    tip = next(one for one in dataset.wing.markers if one.name == "tip")
    assert tip.position == pytest.approx((0.02, HINGE[0] + 0.45, HINGE[1]), abs=0.02)
    assert [str(one) for one in examine(dataset)] == []
    assumed = {one.what for one in start.facts if one.source.startswith("assumed")}
    assert assumed == {"planform", "mass", "air", "airspeed"}
    assert "ASSUMED" in start.files["dataset.yaml"]


def test_other_tracks_become_series_of_positions(tmp_path: Path) -> None:
    start = start_dataset([read(wing_table())], "arm", Conditions())
    (tmp_path / "arm" / "recordings").mkdir(parents=True)
    for name, text in start.files.items():
        (tmp_path / "arm" / name).write_text(text)
    series = wingfit.load_dataset(tmp_path / "arm")
    assert series.kind == "series"
    assert [one.name for one in series.channels][:3] == ["in_y_m", "in_z_m", "mid_y_m"], "x never changes"
    assert "3 coordinates that never change: in_x_m, mid_x_m, tip_x_m" in [one.value for one in start.facts][1]
    assert series.channels[0].unit == "m"


def test_the_markers_of_two_wings_are_asked_for_by_name() -> None:
    with pytest.raises(DatasetError, match=r"--markers in,mid,tip$"):
        start_dataset([read(wing_table(both=True), axes=AXES)], "wing", Conditions())
    chosen = read(wing_table(both=True), axes=AXES, markers="in,mid,tip")
    assert start_dataset([chosen], "wing", Conditions()).kind == "wing"


def test_a_frequency_that_the_tracks_do_not_show_is_asked_for() -> None:
    rng = np.random.default_rng(3)
    rows = [f"{t / 100:.2f}," + ",".join(f"{v:.4f}" for v in rng.normal(0.3, 0.1, 3)) for t in range(100)]
    tracks = read("time_s,tip_x_m,tip_y_m,tip_z_m\n" + "\n".join(rows), axes=AXES)
    with pytest.raises(DatasetError, match="--flap-frequency-hz"):
        start_dataset([tracks], "wing", Conditions())
    with pytest.raises(DatasetError, match="does not flap at 5 Hz, which explains"):
        start_dataset([tracks], "wing", Conditions(flap_frequency_hz=5.0))
    short = read(wing_table(seconds=0.4), axes=AXES)
    with pytest.raises(DatasetError, match="--flap-frequency-hz"):
        start_dataset([short], "wing", Conditions())
    assert start_dataset([short], "wing", Conditions(flap_frequency_hz=3.3)).flap_frequency_hz == (3.3,)


def test_the_frequency_of_a_beat_that_stops_is_found() -> None:
    times = np.arange(0, 3, 0.005)
    flaps = np.where(times < 1.2, np.sin(2 * np.pi * 4.7 * times), 0.0) + 0.2 * times
    positions = np.stack([0 * times, 0.3 + 0.02 * flaps, 0.3 * flaps], axis=1)[:, None]
    found = flap_frequency(times, positions)
    assert found is not None
    assert found == pytest.approx(4.7, rel=0.03)
    assert flap_frequency(times, np.zeros_like(positions)) is None


def test_several_files_are_recordings_of_one_dataset(tmp_path: Path) -> None:
    tracks = read(wing_table(), axes=AXES)
    dataset = loaded(start_dataset([tracks, tracks], "wing", Conditions(airspeed_m_s=4.0)), tmp_path / "two")
    assert [one.name for one in dataset.recordings] == ["file", "file-2"]
    assert dataset.recordings[1].condition.airspeed == 4.0
    with pytest.raises(DatasetError, match="has other markers than"):
        start_dataset([tracks, read(wing_table(), axes=AXES, markers="tip")], "wing", Conditions())


@pytest.mark.skipif(not HAWKS.exists(), reason="the recordings of hawks are not there")
@pytest.mark.parametrize(
    ("name", "hertz"), [("01_09_017_2", 4.7), ("03_05_002", 4.85), ("04_12_268", 4.97), ("05_09_057_1", 3.7)]
)
def test_flights_of_hawks_become_datasets_that_no_check_refuses(name: str, hertz: float, tmp_path: Path) -> None:
    for side, axes in (("right", "x out, y fore, z up"), ("left", "x in, y fore, z up")):
        tracks = wingfit.import_tracks(
            HAWKS, unit="m", time_unit="s", rows=f"seqID={name}", axes=axes, markers=f"{side}_[wps]*"
        )
        start = start_dataset([tracks], "hawk", Conditions(rows=f"seqID={name}"))
        dataset = loaded(start, tmp_path / side)
        assert dataset.recordings[0].name == name
        assert dataset.recordings[0].condition.flap_frequency == pytest.approx(hertz, rel=0.12)
        assert not [str(one) for one in examine(dataset) if one.certain]


def tracks_of(
    hertz: float = 5.0,
    rate: float = 200.0,
    beats: float = 10.0,
    *,
    noise: float = 0.0,
    drift: float = 0.0,
    side: int = 1,
    distances: tuple[float, ...] = (0.1, 0.2, 0.45),
    seen: float = 1.0,
) -> ImportedTracks:
    """Tracks of markers at ``distances`` (m) from HINGE that flap by 30 deg; ``drift`` upwards, m/s."""
    rng = np.random.default_rng(5)
    times = np.arange(int(beats * rate / hertz)) / rate
    angle = np.radians(30) * np.cos(2 * np.pi * hertz * times)
    columns = [times]
    for m, r in enumerate(distances):
        y, z = side * (HINGE[0] + r * np.cos(angle)), HINGE[1] + r * np.sin(angle) + drift * times
        place = [0.02 * m + 0 * times, y, z]
        gone = rng.random(len(times)) > seen
        columns += [np.where(gone, np.nan, one + noise * rng.standard_normal(len(times))) for one in place]
    names = ",".join(f"m{m}_{axis}_m" for m in range(len(distances)) for axis in "xyz")
    rows = "\n".join(",".join(f"{value:.6f}" for value in row) for row in np.column_stack(columns))
    return read(f"time_s,{names}\n{rows}", axes=AXES)


@pytest.mark.parametrize(
    ("hertz", "rate", "beats"), [(5.0, 200.0, 300.0), (40.0, 200.0, 10.0), (5.0, 2000.0, 100.0), (5.0, 200.0, 1.6)]
)
def test_the_frequency_is_right_in_long_fast_and_short_recordings(hertz: float, rate: float, beats: float) -> None:
    start = start_dataset([tracks_of(hertz, rate, beats)], "wing", Conditions())
    assert start.flap_frequency_hz == pytest.approx((hertz,), rel=0.01)


@pytest.mark.parametrize(("hertz", "beats"), [(60.0, 100.0), (90.0, 100.0), (5.0, 1.3)])
def test_a_beat_too_fast_for_the_camera_or_too_short_is_asked_for(hertz: float, beats: float) -> None:
    tracks = tracks_of(hertz, 200.0, beats)
    with pytest.raises(DatasetError, match="shows no clear flap frequency"):
        start_dataset([tracks], "wing", Conditions())


def described(tracks: ImportedTracks) -> dict[str, str]:
    return {one.what: f"{one.value}; {one.source}" for one in start_dataset([tracks], "wing", Conditions()).facts}


def test_gaps_do_not_hide_the_frequency() -> None:
    assert described(tracks_of(seen=0.85))["flap angle"].startswith("30.0 deg")


@pytest.mark.parametrize(
    ("noise", "distances"), [(0.01, (0.1, 0.2, 0.45)), (0.001, (0.002, 0.3, 0.45)), (0.001, (0.3,))]
)
def test_noise_and_a_marker_at_the_hinge_do_not_move_the_hinge(noise: float, distances: tuple[float, ...]) -> None:
    dataset = described(tracks_of(noise=noise, distances=distances))
    assert "from the tracks" in dataset["hinge"]
    assert float(dataset["hinge"].split()[1]) == pytest.approx(1e3 * HINGE[0], abs=10)
    assert float(dataset["flap angle"].split()[0]) == pytest.approx(30, rel=0.04)


def test_a_body_that_moves_is_refused_or_its_hinge_assumed() -> None:
    assert "assumed" in described(tracks_of(drift=0.05))["hinge"]
    assert "not exact" in described(tracks_of(drift=0.05))["flap angle"]
    with pytest.raises(DatasetError, match="as on a body that moves"):
        start_dataset([tracks_of(drift=1.0)], "wing", Conditions())


def test_a_wing_on_the_other_side_is_refused() -> None:
    with pytest.raises(DatasetError, match="exchange 'in' and 'out' in --axes"):
        start_dataset([tracks_of(side=-1)], "wing", Conditions())


def test_a_frequency_at_which_nothing_moves_is_refused() -> None:
    with pytest.raises(DatasetError, match="does not flap at 40 Hz, which explains 0 %"):
        start_dataset([tracks_of()], "wing", Conditions(flap_frequency_hz=40.0))
