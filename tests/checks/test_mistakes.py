"""Each mistake is named with its cause, and undone in a copy; datasets without mistakes pass."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.checks.samples import good_vehicle, good_wing
from tests.oracles.mistakes import KINDS
from wingfit.checks import DatasetWarning, check_dataset, examine, load_dataset
from wingfit.checks.repair import repaired
from wingfit.checks.zeros import check_zero_forces
from wingfit.records import Dataset, DatasetError, Materials, save_dataset
from wingfit.records import load_dataset as read_dataset
from wingfit.records.files.folder import contents
from wingfit.records.wing import Structure

GOOD = {"wing": good_wing(), "vehicle": good_vehicle()}
EXAMPLES = Path(__file__).parents[2] / "examples"


def written(dataset: Dataset, folder: Path) -> Path:
    for name, data in contents(dataset, plausible=False).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    return folder


@pytest.mark.parametrize("name", ["robird", "delfly", "pendulum"])
def test_the_examples_have_no_mistake(name: str) -> None:
    assert check_dataset(EXAMPLES / name).mistakes == ()


@pytest.mark.parametrize("rig", ["wing", "vehicle"])
def test_good_datasets_have_no_mistake(rig: str) -> None:
    assert examine(GOOD[rig]) == ()


@pytest.mark.parametrize("structure", ["rigid", "sheet"])
def test_a_wing_without_rods_is_checked(structure: Structure) -> None:
    """It has no rear rod whose lag could be compared; all other checks hold for it as well."""
    rods = good_wing()
    plain = replace(rods.wing, structure=structure, rods=(), driven_rods=(), materials=Materials(0.0, 1.1))
    unlagged = tuple(replace(one, condition=replace(one.condition, phase_lag=0.0)) for one in rods.recordings)
    assert examine(Dataset("animal", plain, unlagged)) == ()
    inches = tuple(replace(one, values=one.values / 0.0254) for one in unlagged)
    assert {one.kind for one in examine(Dataset("animal", plain, inches))} == {"length unit"}


def test_what_frames_do_not_show_is_not_compared_with_the_drive() -> None:
    """Eight frames in a third of the beat fit any amplitude: even 1700 degrees, as if the drive were in radians."""
    good = good_wing()
    first = good.recordings[1]
    few = replace(first, times=first.times[0] + np.arange(8) * 0.004, values=first.values[:8])
    assert not {one.kind for one in examine(replace(good, recordings=(few,)))} & {"amplitude", "mean angle"}


def test_the_longest_steady_part_is_proposed_as_window() -> None:
    """A rig that glides twice: the window does not span the glides."""
    good = good_wing()
    first = good.recordings[0]
    count = len(first.times)
    still = np.zeros(count, dtype=bool)
    still[count // 8 : count // 4] = True
    mean = np.nanmean(first.values, axis=0)
    glides = replace(first, values=np.where(still[:, None], mean, first.values))
    remark = next(one for one in examine(replace(good, recordings=(glides,))) if one.kind == "unsteady")
    start = float(remark.change.partition("window_s: [")[2].partition(",")[0])
    assert start >= first.times[0] + 0.2 * np.ptp(first.times)


CAUGHT = [
    "wing: gaps filled with zeros", "wing: gaps filled with 9999", "wing: marker held for a fifth of the frames",
    "wing: two neighbours exchanged", "wing: names shifted by one", "wing: offset of the linkage in radians",
    "wing: phase lag in radians", "wing: sign of the phase lag", "wing: pressure in kPa", "wing: airspeed in km/h",
    "wing: temperature in Fahrenheit", "wing: rods in g/cm^3", "wing: foam in g/cm^3",
    "wing: masses of markers in grams", "wing: thickness ten times", "wing: millimetres", "vehicle: sign of x",
    "vehicle: sign of z", "vehicle: both signs: forces on the balance", "vehicle: x and z exchanged",
    "vehicle: gram-force", "vehicle: time zero a quarter beat late", "vehicle: lost samples are zeros",
    "vehicle: pressure in kPa", "vehicle: mass in grams", "vehicle: times in milliseconds",
    "vehicle: body pitch in radians", "vehicle: sign of x, one recording", "vehicle: gram-force, one recording",
    "vehicle: x and z exchanged, one recording", "vehicle: a quarter beat late, one recording",
]  # fmt: skip


@pytest.mark.parametrize("name", CAUGHT)
def test_a_mistake_is_named_and_undone(name: str, tmp_path: Path) -> None:
    kind = KINDS[name]
    good = GOOD[kind.rig]
    wrong = kind.make(good, np.random.default_rng(1))
    assert wrong is not None
    source = written(wrong, tmp_path / "wrong")
    before = {path: path.read_bytes() for path in source.rglob("*") if path.is_file()}
    mistakes = check_dataset(source).mistakes
    assert {one.kind for one in mistakes} & set(kind.causes), [str(one) for one in mistakes]
    edits = repaired(source, tmp_path / "fixed", mistakes)
    assert edits
    assert {path: path.read_bytes() for path in source.rglob("*") if path.is_file()} == before
    again = check_dataset(tmp_path / "fixed")
    assert again.mistakes == ()
    assert isinstance(again.dataset, Dataset)
    for fixed, right in zip(again.dataset.recordings, good.recordings, strict=True):
        np.testing.assert_allclose(fixed.times, right.times, rtol=1e-9, atol=0.012)
        both = np.isfinite(fixed.values) & np.isfinite(right.values)
        assert both.mean() > 0.7
        np.testing.assert_allclose(fixed.values[both], right.values[both], atol=1e-9)


SEEN = [
    "wing: origin 0.3 spans aft", "wing: frame rotated by 30 degrees about z", "wing: jumps",
    "wing: a recording copied",
    "wing: rig at rest for a third", "wing: one column constant", "wing: a stream in the vacuum chamber",
    "vehicle: a recording copied", "vehicle: wings stop in the last third", "vehicle: one axis constant",
    "vehicle: thickness a thousand times", "vehicle: sign of z, one recording",
    "vehicle: sign of the body pitch, one recording",
]  # fmt: skip


@pytest.mark.parametrize("name", SEEN)
def test_a_mistake_that_only_the_user_can_undo_is_named(name: str) -> None:
    kind = KINDS[name]
    wrong = kind.make(GOOD[kind.rig], np.random.default_rng(1))
    assert wrong is not None
    assert {one.kind for one in examine(wrong)} & set(kind.causes)


def test_what_was_verified_is_no_mistake(tmp_path: Path) -> None:
    wrong = KINDS["vehicle: sign of z"].make(GOOD["vehicle"], np.random.default_rng(1))
    assert isinstance(wrong, Dataset)
    assert [one.kind for one in examine(wrong)] == ["force axes"]
    written(replace(wrong, verified=("unsteady", "force axes")), tmp_path / "unusual")
    again = check_dataset(tmp_path / "unusual")
    assert again.mistakes == ()
    assert isinstance(again.dataset, Dataset)
    assert again.dataset.verified == ("unsteady", "force axes")
    text = (tmp_path / "unusual/dataset.yaml").read_text()
    (tmp_path / "unusual/dataset.yaml").write_text(text.replace("unsteady", "unstedy"))
    with pytest.raises(DatasetError, match="'unsteady'"):
        read_dataset(tmp_path / "unusual")


def test_what_is_certain_cannot_be_verified() -> None:
    wrong = KINDS["vehicle: lost samples are zeros"].make(GOOD["vehicle"], np.random.default_rng(1))
    assert isinstance(wrong, Dataset)
    assert any(one.certain for one in examine(replace(wrong, verified=("placeholders",))))


def test_certain_mistakes_are_refused_and_doubtful_ones_warned_about(tmp_path: Path) -> None:
    wing = GOOD["wing"]
    left = KINDS["wing: left wing: y negative"].make(wing, np.random.default_rng(1))
    assert isinstance(left, Dataset)
    save_dataset(left, tmp_path / "left.zip")
    with pytest.raises(DatasetError, match="a left wing, which must be mirrored"):
        load_dataset(tmp_path / "left.zip")
    assert read_dataset(tmp_path / "left.zip").name == "wing", "what is stored is read without these checks"
    thin = replace(wing.recordings[2], condition=replace(wing.recordings[2].condition, pressure=10_132.5))
    save_dataset(replace(wing, recordings=(*wing.recordings[:2], thin)), tmp_path / "thin.nc")
    with pytest.warns(DatasetWarning, match="the pressure is in kPa"):
        load_dataset(tmp_path / "thin.nc")


def test_the_copy_is_written_beside_and_keeps_comments(tmp_path: Path) -> None:
    source = tmp_path / "source"
    shutil.copytree(EXAMPLES / "robird", source)
    text = (source / "dataset.yaml").read_text(encoding="utf-8")
    new = text.replace("foam_density_kg_m3: 30.0", "foam_density_kg_m3: 0.03", 1) + "# measured on a rainy day\n"
    assert new.count("0.03") > text.count("0.03")
    (source / "dataset.yaml").write_text(new, encoding="utf-8")
    repaired(source, tmp_path / "copy", check_dataset(source).mistakes)
    fixed = (tmp_path / "copy" / "dataset.yaml").read_text(encoding="utf-8")
    assert fixed == new.replace("foam_density_kg_m3: 0.03", "foam_density_kg_m3: 30", 1)
    with pytest.raises(DatasetError, match="nothing is overwritten"):
        repaired(source, tmp_path / "copy", ())


def test_the_standard_atmosphere_in_mmhg_is_a_warning_and_mountains_are_not() -> None:
    wing = good_wing()
    tunnel = wing.recordings[2]

    def causes(pascal: float) -> list[str]:
        thin = replace(tunnel, condition=replace(tunnel.condition, pressure=pascal))
        found = examine(replace(wing, recordings=(*wing.recordings[:2], thin)))
        assert not [one for one in found if one.certain]
        return [one.cause for one in found if one.kind == "air pressure"]

    assert causes(76_000.0) == ["the pressure is in mmHg"]
    assert causes(75_000.0) == causes(77_000.0) == []


def test_numbers_that_a_coarse_converter_repeats_fill_no_gaps() -> None:
    """With few steps in the range, both axes often have one number at once; one that fills gaps is still found."""
    first = good_vehicle().recordings[0]
    phase = first.times * first.condition.flap_frequency
    peak = np.exp(-((((phase + 0.5) % 1.0 - 0.5) / 0.05) ** 2))
    forces = np.stack([np.sin(2 * np.pi * phase) + peak, 0.3 * np.cos(2 * np.pi * phase) + 0.8 * peak], axis=1)
    noise = np.random.default_rng(1).normal(0.0, 0.01, forces.shape)
    coarse = replace(first, values=np.round((forces + noise) / 0.2) * 0.2)
    assert (coarse.values == 1.0).all(axis=1).sum() > 30
    assert check_zero_forces(coarse) is None
    lost = np.random.default_rng(2).random(len(phase)) < 0.3
    found = check_zero_forces(replace(coarse, values=np.where(lost[:, None], 0.0, coarse.values)))
    assert found is not None
    assert "are exactly 0 N on every axis" in found.value
