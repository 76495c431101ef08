"""Every file format stores a dataset of forces exactly: folder, zip and NetCDF."""

from __future__ import annotations

import math
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.contract.test_dataset_files import NAMES, angles, names, prose, right_angles, titles
from tests.records.compare import assert_same
from tests.records.vehicles import FORCES, delfly_dataset, good_vehicle
from wingfit.records import (
    ChordStation,
    Condition,
    Dataset,
    Flap,
    FourierFlap,
    FourierPitch,
    LowPass,
    PassivePitch,
    Pitch,
    Recording,
    SplitCycleFlap,
    Vehicle,
    WingMotion,
    load_dataset,
    save_dataset,
)
from wingfit.records.dataset import ForceAxis, Rig
from wingfit.records.files.forces import read_forces


@pytest.mark.parametrize("name", NAMES)
def test_sample_returns_exactly(tmp_path: Path, name: str) -> None:
    dataset = delfly_dataset()
    save_dataset(dataset, tmp_path / name)
    assert_same(load_dataset(tmp_path / name), dataset)


@pytest.mark.parametrize("name", NAMES)
def test_saving_what_was_loaded_gives_the_same_files(tmp_path: Path, name: str) -> None:
    save_dataset(delfly_dataset(), tmp_path / name)
    save_dataset(load_dataset(tmp_path / name), tmp_path / "again")
    again = {
        p.relative_to(tmp_path / "again").as_posix(): p.read_bytes()
        for p in (tmp_path / "again").rglob("*")
        if p.is_file()
    }
    assert again == dict(good_vehicle())


def test_the_channels_are_x_before_z_whatever_the_file_s_order() -> None:
    text = "force_z_n,time_s,force_x_n\n" + "".join(f"2,{k},1\n" for k in range(8))
    samples = read_forces(text.encode(), FORCES)
    assert samples.forces == ("x", "z")
    assert samples.values[0].tolist() == [1.0, 2.0]
    assert samples.times.tolist() == list(range(8))


beats = st.floats(1e-3, 0.5)
masses = st.floats(0.1, 100.0)
newtons = st.floats(-4.0, 4.0) | st.just(-0.0) | st.just(5e-324) | st.just(math.nan)


@st.composite
def series(draw: st.DrawFn) -> tuple[float, tuple[float, ...], tuple[float, ...]]:
    count = draw(st.integers(1, 4))
    terms = st.lists(angles, min_size=count, max_size=count).map(tuple)
    return draw(angles), draw(terms), draw(terms)


@st.composite
def motions(draw: st.DrawFn) -> WingMotion:
    split = st.builds(
        SplitCycleFlap, st.floats(0.0, math.pi / 2), right_angles, st.floats(-12.0, 2.5), st.floats(0.0, 0.1)
    )
    flap: Flap = draw(split | series().map(lambda terms: FourierFlap(*terms)))
    small = st.floats(-10.0, 10.0)
    passive = st.builds(PassivePitch, small, st.floats(-100.0, 100.0), small, small)
    pitch: Pitch = draw(passive | series().map(lambda terms: FourierPitch(*terms)))
    return WingMotion(flap, pitch, draw(angles), draw(st.floats(1e-3, 1.0)), draw(beats))


@st.composite
def vehicles(draw: st.DrawFn) -> Vehicle:
    places = sorted(draw(st.lists(st.floats(1e-6, 10.0), min_size=1, max_size=4, unique=True)))
    chords = draw(st.lists(st.floats(1e-4, 5.0), min_size=len(places) + 1, max_size=len(places) + 1))
    return Vehicle(
        name=draw(titles),
        layout=draw(st.sampled_from(["x4", "pair", "single"])),
        claps=False,
        stations=tuple(ChordStation(r, chord) for r, chord in zip((0.0, *places), chords, strict=True)),
        wing_mass=draw(st.floats(1e-6, 0.02)),
        thickness=draw(st.floats(1e-9, 0.5)),
        pitch_axis=draw(st.floats(0.0, 1.0)),
        dihedral=draw(right_angles),
        mass=draw(masses),
        motion=draw(motions()),
        velocities=draw(st.sampled_from(["mirrored", "printed"])),
        estimates=draw(st.dictionaries(st.from_regex(r"C_[a-z0-9]{1,4}", fullmatch=True), st.floats(-1e300, 1e300))),
    )


@st.composite
def recordings(draw: st.DrawFn, name: str) -> Recording:
    condition = Condition(
        flap_frequency=draw(st.floats(0.01, 1000.0)),
        phase_lag=0.0,
        pressure=draw(st.floats(0.0, 2e6)),
        temperature=draw(st.floats(174.0, 373.0)),
        airspeed=draw(st.floats(0.0, 100.0)),
        angle_of_attack=draw(right_angles),
        gravity=draw(st.floats(0.0, 30.0)),
    )
    frames = draw(st.integers(8, 12))
    times: npt.NDArray[np.float64] = draw(st.floats(0.0, 5.0)) + np.arange(frames, dtype=np.float64) * 2.0 / (
        frames * condition.flap_frequency
    )
    axes: list[tuple[ForceAxis, ...]] = [("x",), ("z",), ("x", "z")]
    forces = draw(st.sampled_from(axes))
    size = frames * len(forces)
    values = np.array(draw(st.lists(newtons, min_size=size, max_size=size))).reshape(frames, len(forces))
    values[0] = 1.0
    deviations = st.lists(st.floats(1e-9, 100.0), min_size=len(forces), max_size=len(forces)).map(np.array)
    filters = st.builds(LowPass, st.floats(1.0, 1.9).map(lambda share: share * condition.flap_frequency))
    rig: Rig = draw(st.sampled_from(["wind_tunnel", "free_flight", "vacuum_chamber"]))
    return Recording(
        name,
        rig,
        condition,
        times,
        (),
        values,
        draw(st.none() | deviations),
        forces=forces,
        low_pass=draw(st.none() | st.builds(replace, filters, order=st.integers(1, 8))),
        motion=draw(st.none() | motions()),
        mass=draw(st.none() | masses),
    )


@st.composite
def datasets(draw: st.DrawFn) -> Dataset:
    keys = draw(st.lists(names, min_size=1, max_size=3, unique_by=str.lower))
    parts = tuple(draw(recordings(name)) for name in keys)
    return Dataset(draw(titles), draw(vehicles()), parts, tuple(keys[1:]), draw(prose))


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
@given(datasets())
def test_any_dataset_returns_exactly(dataset: Dataset) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for name in NAMES:
            save_dataset(dataset, Path(folder) / name)
            assert_same(load_dataset(Path(folder) / name), dataset)
