"""What the page of a dataset shows: tracks, forces and gaps, against the numbers of the files themselves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import yaml

import wingfit
from tests.checks.samples import good_wing
from tests.records.series_samples import arm_dataset
from tests.service.conftest import Api
from tests.service.rigs.test_drive import client_of
from tests.service.shapes import valid
from wingfit.checks import CHECKS
from wingfit.client.recorded import answers as a
from wingfit.client.transport import zip_folder
from wingfit.records import CameraPose, Dataset, FrameError, Recording, load_dataset
from wingfit.records.files.netcdf import write_netcdf
from wingfit.records.mistake_kinds import MistakeKind
from wingfit.service.datasets import beat_views, gaps, wing_views
from wingfit.sim.wing.alignment import recorded_crossing

EXAMPLES = Path(__file__).parents[3] / "examples"
RECORDING, FREQUENCY = "vac-0010mbar-lag7-4.0hz", 4.0


def table(example: str, recording: str) -> dict[str, Any]:
    """The columns of the CSV of a recording, by name."""
    path = EXAMPLES / example / "recordings" / f"{recording}.csv"
    found = np.genfromtxt(path, delimiter=",", names=True)
    return {name: found[name] for name in found.dtype.names or ()}


@pytest.fixture(scope="module")
def robird() -> Dataset:
    found = load_dataset(EXAMPLES / "robird")
    assert isinstance(found, Dataset)
    return found


@pytest.fixture(scope="module")
def shown(robird: Dataset) -> Any:
    return valid(a.Tracks, beat_views.tracks(robird.recording(RECORDING), robird.wing, None))


@pytest.fixture(scope="module")
def delfly(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    found = load_dataset(zip_folder(EXAMPLES / "delfly", tmp_path_factory.mktemp("delfly") / "delfly.zip"))
    assert isinstance(found, Dataset)
    return found


def test_the_mean_beat_is_that_of_the_file(robird: Dataset, shown: Any) -> None:
    """Every position is the mean of those frames of the file whose phase is in the same part of the beat."""
    columns = table("robird", RECORDING)
    assert shown.start == "reference markers"
    late = recorded_crossing(robird.wing, robird.recording(RECORDING)) / (2 * np.pi)
    phase = (FREQUENCY * columns["time_s"] - late) % 1.0
    reference = [name for name in robird.wing.reference_markers if name in shown.markers]
    height = np.nanmean([columns[f"{name}_z_m"] for name in reference], axis=0)[np.argsort(phase)]
    assert height[-1] < 0.0 < height[1], "the beat starts where the reference markers pass the hinge upwards"
    part = (phase * min(len(phase) // beat_views.FRAMES_PER_PHASE, beat_views.MOST_PHASES)).astype(int)
    assert shown.phase == pytest.approx([phase[part == group].mean() for group in np.unique(part)], abs=1e-5)
    for m in (0, len(shown.markers) - 1):
        file = 1e3 * np.stack([columns[f"{shown.markers[m]}_{axis}_m"] for axis in "xyz"], axis=1)
        for k, group in enumerate(np.unique(part)):
            assert shown.positions_mm[k][m] == pytest.approx(np.nanmean(file[part == group], axis=0), abs=1e-3)


def test_distances_are_those_of_the_turned_rest_positions(robird: Dataset, shown: Any) -> None:
    """The best angle of each frame is found by trying angles, not by the formula."""
    columns = table("robird", RECORDING)
    markers = yaml.safe_load((EXAMPLES / "robird" / "dataset.yaml").read_text())["wing"]["markers"]
    rest = {one["name"]: np.array([one["x_m"], one["y_m"], one["z_m"]]) for one in markers}
    places = np.stack([[columns[f"{name}_{axis}_m"] for axis in "xyz"] for name in shown.markers]).transpose(2, 0, 1)
    still = np.stack([rest[name] for name in shown.markers])
    angles = np.radians(np.linspace(-60.0, 60.0, 4801))
    cosine, sine = np.cos(angles)[:, None], np.sin(angles)[:, None]
    x = np.broadcast_to(still[:, 0], (len(angles), len(still)))
    turned = np.stack([x, cosine * still[:, 1] - sine * still[:, 2], sine * still[:, 1] + cosine * still[:, 2]], axis=2)
    squares = np.zeros((len(places), len(still)))
    for t, frame in enumerate(places):
        off = ((frame - turned) ** 2).sum(axis=2)
        squares[t] = off[np.nansum(off, axis=1).argmin()]
    assert shown.distance_mm == pytest.approx(1e3 * np.sqrt(np.nanmean(squares, axis=0)), abs=0.02)
    assert shown.misfit_mm == pytest.approx(1e3 * np.sqrt(np.nanmean(squares)), abs=0.02)
    assert shown.misfit_percent == pytest.approx(100 * shown.misfit_mm / 490.0, rel=1e-6)
    assert shown.missing == np.isnan(places).any(axis=2).sum(axis=0).tolist()
    assert robird.wing.span == pytest.approx(0.49)


def test_a_single_beat_has_the_frames_of_the_file() -> None:
    """Two beats of 40 frames each, of which the second one misses a marker once."""
    good = good_wing()
    first = good.recordings[0]
    times = np.arange(80) / 40.0 / first.condition.flap_frequency
    angle = 0.4 * np.sin(2 * np.pi * np.arange(80) / 40.0 + 1e-3)
    marker = good.wing.markers[-1]
    arm = np.hypot(marker.position[1] - good.wing.hinge.y, marker.position[2] - good.wing.hinge.z)
    places = np.stack([np.full(80, marker.position[0]), arm * np.cos(angle), arm * np.sin(angle)], axis=1)
    places[50] = np.nan
    wing = replace(good.wing, reference_markers=(marker.name,))
    recording = replace(first, times=times, markers=(marker.name,), values=places, standard_deviation=None)
    mean = valid(a.Tracks, beat_views.tracks(recording, wing, None))
    assert (mean.beats, mean.beat, mean.missing) == (2, None, [1])
    second = valid(a.Tracks, beat_views.tracks(recording, wing, 2))
    expected = [None if np.isnan(row).any() else pytest.approx(1e3 * row, abs=6e-4) for row in places[40:]]
    found = [None if None in frame[0] else frame[0] for frame in second.positions_mm]
    assert found == expected
    with pytest.raises(ValueError, match=r"no frame of beat 9; it has those of beats 1 to 2"):
        beat_views.tracks(recording, wing, 9)


@pytest.mark.parametrize(("order", "signs", "kind"), [((1, 0, 2), (1, 1, 1), "far"), ((0, 1, 2), (1, 1, 1), "near")])
def test_exchanged_axes_are_far(robird: Dataset, order: Any, signs: Any, kind: str) -> None:
    recording = robird.recording(RECORDING)
    moved = (recording.positions[:, :, list(order)] * signs).reshape(recording.values.shape)
    found = beat_views.tracks(replace(recording, values=moved), robird.wing, None)
    assert found["misfit_percent"] is not None
    assert (found["misfit_percent"] > 15.0) is (kind == "far")


def test_the_described_wing_is_that_of_the_file(robird: Dataset) -> None:
    cameras = (CameraPose.of("left", np.array([1.0, 2.0, 3.0]), np.eye(3), 900.0),)
    whole = replace(robird, frame_error=FrameError((0.01, 0.0, 0.0), (0.001, 0.002, 0.003)), cameras=cameras)
    found = valid(a.DescribedWing, wing_views.described_wing(whole))
    file = yaml.safe_load((EXAMPLES / "robird" / "dataset.yaml").read_text())["wing"]
    assert [one.position_mm for one in found.markers] == [
        pytest.approx([1e3 * one[f"{axis}_m"] for axis in "xyz"]) for one in file["markers"]
    ]
    assert [one.name for one in found.markers if one.reference] == file["reference_markers"]
    rod = file["rods"][0]
    ends = [[1e3 * rod["x_root_m"], 1e3 * rod["y_root_m"], 0.0], [1e3 * rod["x_tip_m"], 1e3 * rod["y_tip_m"], 0.0]]
    assert [found.rods[0].root_mm, found.rods[0].tip_mm] == [pytest.approx(end) for end in ends]
    stations = file["stations"]
    assert found.outline_mm[0] == [1e3 * stations[0]["leading_edge_m"], 1e3 * stations[0]["y_m"], 0.0]
    tip = stations[-1]
    assert found.outline_mm[len(stations)] == pytest.approx(
        [1e3 * (tip["leading_edge_m"] + tip["chord_m"]), 1e3 * tip["y_m"], 0.0]
    )
    assert found.frame_error.rotation_deg == pytest.approx([np.degrees(0.01), 0.0, 0.0])
    assert found.frame_error.origin_mm == pytest.approx([1.0, 2.0, 3.0])
    assert found.cameras[0].centre_mm == [1000.0, 2000.0, 3000.0]
    assert max(found.drive_deg) - min(found.drive_deg) > 20.0


def test_gaps_are_counted_and_located() -> None:
    values, times = np.arange(10.0), np.arange(10) / 4.0
    values[[0, 3, 4, 5, 9]] = np.nan
    found = gaps.missing(values, times)
    assert found["samples"] == 5
    assert found["gaps"] == [
        {"from_s": 0.0, "to_s": 0.0, "samples": 1},
        {"from_s": 0.75, "to_s": 1.25, "samples": 3},
        {"from_s": 2.25, "to_s": 2.25, "samples": 1},
    ]
    values[:] = np.where(np.arange(10) % 2, 1.0, np.nan)
    assert gaps.missing(np.tile(values, 100), np.arange(1000.0))["samples"] == 500
    assert len(gaps.missing(np.tile(values, 100), np.arange(1000.0))["gaps"]) == gaps.MOST_GAPS


def test_samples_of_a_marker_are_those_of_the_file(robird: Dataset) -> None:
    columns = table("robird", RECORDING)
    found = valid(a.Samples, beat_views.samples(robird.recording(RECORDING), robird.wing, "m43"))
    assert (found.unit, found.samples, found.stride) == ("mm", len(columns["time_s"]), 1)
    assert found.time_s == pytest.approx(columns["time_s"], abs=1e-6)
    for channel, axis in zip(found.channels, "xyz", strict=True):
        file = 1e3 * columns[f"m43_{axis}_m"]
        assert channel.name == axis
        assert channel.missing.samples == np.isnan(file).sum()
        assert [np.nan if value is None else value for value in channel["values"]] == pytest.approx(file, nan_ok=True)


def test_forces_over_the_beat_are_those_of_the_file(delfly: Dataset) -> None:
    columns = table("delfly", "test-7")
    recording = delfly.recording("test-7")
    found = valid(a.Forces, beat_views.forces(recording, delfly.vehicle))
    pitch, frequency = np.radians(45.0), recording.condition.flap_frequency
    x, z = columns["force_x_n"], columns["force_z_n"]
    files = {"x": x, "z": z, "lift": (x - z) * np.sin(pitch), "drag": -(x + z) * np.cos(pitch)}
    part = (frequency * columns["time_s"] % 1.0 * beat_views.FORCE_PHASES).astype(int)
    assert [one.name for one in found.forces] == list(files)
    for one in found.forces:
        means = [files[one.name][part == k].mean() for k in np.unique(part)]
        assert one.mean_n == pytest.approx(means, abs=1e-5), one.name
    assert found.weight_n == pytest.approx(0.0184 * 9.80665), "the mass of the recording, not of the vehicle"
    assert min(found.flap_deg) == pytest.approx(0.0, abs=2.0), "the beat starts where the wings are closest"
    assert found.flap_deg.index(max(found.flap_deg)) == pytest.approx(len(found.phase) / 2, abs=0.1 * len(found.phase))
    over_time = valid(a.Samples, beat_views.samples(recording, None, None))
    assert over_time.channels[0]["values"] == pytest.approx(x)


def test_a_long_recording_is_thinned() -> None:
    """60 beats of 49 markers, 5 MB as text: little is sent, and gaps between the samples that are sent count."""
    good = good_wing()
    first = good.recordings[0]
    count = 60 * 120
    times = np.arange(count) / 120.0 / first.condition.flap_frequency
    names = tuple(one.name for one in good.wing.markers)
    values = np.random.default_rng(1).normal(size=(count, 3 * len(names)))
    values[101] = np.nan
    long = replace(first, times=times, markers=names, values=values, standard_deviation=None, noise_correlation=None)
    found = beat_views.samples(long, good.wing, names[0])
    assert (found["stride"], len(found["time_s"])) == (2, count // 2)
    assert [one["missing"]["samples"] for one in found["channels"]] == [1, 1, 1]
    mean = beat_views.tracks(long, good.wing, None)
    assert len(mean["phase"]) == beat_views.MOST_PHASES
    assert len(str(mean)) + len(str(found)) < 400_000


def test_every_mistake_belongs_to_one_check() -> None:
    finds = [kind for check in CHECKS for kind in check.finds]
    assert sorted(finds) == sorted(get_args(MistakeKind))
    assert [one["name"] for one in wing_views.checks("series", [])["checks"]] == ["copies", "constant columns"]
    found = valid(a.Checks, wing_views.checks("tracks", [{"kind": "side"}, {"kind": "tilt"}, {"kind": "cut"}]))
    assert {one.name: one.found for one in found.checks if one.found} == {"axes": 2, "steadiness": 1}
    assert wing_views.checks("tracks", None)["carried_out"] is False


def test_routes_answer_for_their_kind_of_dataset(api: Api, delfly: Dataset) -> None:
    wing = f"/v1/datasets/{api.upload()['id']}"
    file = {"file": ("delfly.nc", write_netcdf(_short(delfly)))}
    vehicle = f"/v1/datasets/{api.client.post('/v1/datasets', files=file).json()['id']}"
    shapes = {"wing": a.DescribedWing, "tracks": a.Tracks, "samples": a.Samples, "checks": a.Checks}
    for name, shape in shapes.items():
        answer = api.client.get(f"{wing}/{name}")
        assert answer.status_code == 200, answer.text
        valid(shape, answer.json())
        again = api.client.get(f"{wing}/{name}", headers={"If-None-Match": answer.headers["ETag"]})
        assert (again.status_code, again.content) == (304, b"")
        assert api.client.get(f"/v1/datasets/none/{name}").status_code == 404
    tracks = api.get(f"{wing}/tracks?recording=fast")
    assert (tracks["recording"], tracks["start"], tracks["frames"]) == ("fast", "time 0", 4)
    assert api.get(f"{wing}/samples?recording=fast&marker=b")["marker"] == "b"
    valid(a.Forces, api.get(f"{vehicle}/forces"))
    assert api.get(f"{vehicle}/samples")["unit"] == "N"
    for path in (f"{wing}/forces", f"{vehicle}/wing", f"{vehicle}/tracks", f"{vehicle}/samples?marker=tip"):
        assert api.client.get(path).status_code == 409, path
    for query, where in (
        ("tracks?recording=x", "recording"),
        ("tracks?beat=77", "beat"),
        ("samples?marker=x", "marker"),
    ):
        answer = api.client.get(f"{wing}/{query}")
        assert (answer.status_code, answer.json()["errors"][0]["where"]) == (422, f"query.{where}")


def test_the_client_fetches_what_was_recorded(api: Api, delfly: Dataset) -> None:
    wing = api.upload()["id"]
    vehicle, series = (
        api.client.post("/v1/datasets", files={"file": ("x.nc", write_netcdf(one))}).json()["id"]
        for one in (_short(delfly), arm_dataset())
    )
    with client_of(api) as client:
        assert client.described_wing(wing) == api.get(f"/v1/datasets/{wing}/wing")
        assert client.recorded_tracks(wing, "fast") == api.get(f"/v1/datasets/{wing}/tracks?recording=fast")
        assert client.recorded_tracks(wing, beat=1) == api.get(f"/v1/datasets/{wing}/tracks?beat=1")
        assert client.recorded_samples(wing, "fast", marker="b")["marker"] == "b"
        assert client.recorded_forces(vehicle) == api.get(f"/v1/datasets/{vehicle}/forces")
        assert client.recorded_series(series, "heavy") == api.get(f"/v1/datasets/{series}/series?recording=heavy")
        assert client.dataset_checks(series) == api.get(f"/v1/datasets/{series}/checks")
        with pytest.raises(wingfit.WingfitError, match="has tracks, not forces"):
            client.recorded_forces(wing)
        with pytest.raises(wingfit.WingfitError, match="there is no such recording"):
            client.recorded_tracks(wing, "none")


def _short(dataset: Dataset) -> Dataset:
    def cut(one: Recording) -> Recording:
        return replace(one, times=one.times[:400], values=one.values[:400])

    return replace(dataset, recordings=tuple(cut(one) for one in dataset.recordings[:1]), held_out=())
