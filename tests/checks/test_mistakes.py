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
from wingfit.records import Dataset, DatasetError, save_dataset
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
def test_a_wing_without_rods_is_checked_too(structure: Structure) -> None:
    """It has no rods between which a lag could be seen; everything else is compared."""
    bare = replace(GOOD["wing"].wing, structure=structure, rods=(), driven_rods=())
    skin = replace(bare.materials, foam_density=0.0, skin_areal_density=0.3)
    dataset = replace(GOOD["wing"], rig=replace(bare, materials=skin))
    assert examine(dataset) == ()
    first = replace(dataset.recordings[0], values=1e3 * dataset.recordings[0].values)
    assert "length unit" in {one.kind for one in examine(replace(dataset, recordings=(first,)))}


CAUGHT = [
    "wing: gaps filled with zeros", "wing: gaps filled with 9999", "wing: marker held for a fifth of the frames",
    "wing: two neighbours exchanged", "wing: names shifted by one", "wing: offset of the linkage in radians",
    "wing: phase lag in radians", "wing: sign of the phase lag", "wing: pressure in kPa", "wing: airspeed in km/h",
    "wing: temperature in Fahrenheit", "wing: rods in g/cm^3", "wing: foam in g/cm^3",
    "wing: masses of markers in grams", "wing: thickness ten times", "wing: millimetres", "vehicle: sign of x",
    "vehicle: sign of z", "vehicle: both signs: forces on the balance", "vehicle: x and z exchanged",
    "vehicle: gram-force", "vehicle: time zero a quarter beat late", "vehicle: lost samples are zeros",
    "vehicle: pressure in kPa", "vehicle: mass in grams", "vehicle: times in milliseconds",
    "vehicle: body pitch in radians",
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
    "vehicle: thickness a thousand times",
]  # fmt: skip


@pytest.mark.parametrize("name", SEEN)
def test_a_mistake_that_only_the_user_can_undo_is_named(name: str) -> None:
    kind = KINDS[name]
    wrong = kind.make(GOOD[kind.rig], np.random.default_rng(1))
    assert wrong is not None
    assert {one.kind for one in examine(wrong)} & set(kind.causes)


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
