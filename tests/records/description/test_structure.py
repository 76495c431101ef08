"""Descriptions of wings without rods: written and read, and refused where they contradict themselves."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.records.malformed import YAML, error_of_zip, with_yaml, zipped
from tests.sim.wing.without_rods import animal, nominal, recorded
from wingfit.records import load_archive, load_dataset, save_dataset, wing_or_vehicle
from wingfit.records.files.folder import contents
from wingfit.records.wing import Structure
from wingfit.sim.wing.flexible_wing import FlexibleWing


def files(structure: Structure = "rigid", old: str = "", new: str = "") -> dict[str, bytes]:
    model = FlexibleWing(animal("rigid"), "4")
    dataset = recorded(model, nominal(model))
    found = contents(dataset)
    text = found[YAML].decode().replace("structure: rigid", f"structure: {structure}")
    assert old in text
    return {**found, YAML: text.replace(old, new, 1).encode()}


@pytest.mark.parametrize("structure", ["sheet", "rigid"])
def test_a_wing_without_rods_is_written_and_read(structure: Structure, tmp_path: Path) -> None:
    raw = files(structure)
    assert b"rods" not in raw[YAML]
    wing = wing_or_vehicle(load_archive(zipped(raw), "a.zip")).wing
    assert wing == animal(structure)
    dataset = load_archive(zipped(raw), "a.zip")
    for target in ("folder", "a.nc"):
        save_dataset(dataset, tmp_path / target)
        assert wing_or_vehicle(load_dataset(tmp_path / target)).wing == wing


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("structure: rigid", "structure: membrane", "must be 'sheet' or 'rigid'"),
        ("  structure: rigid\n", "", "wing.rods: has 0 entries, at least 2 are needed"),
        ("  structure: rigid\n", "", "foam_density_kg_m3: is 0 kg/m^3; the foam between rods"),
        ("skin_areal_density_kg_m2: 1.2", "skin_areal_density_kg_m2: 0", "both densities are 0; a wing has mass"),
        ("phase_lag_deg: 0.0", "phase_lag_deg: 5", "has no rear rod that lags: it must be 0"),
    ],
)
def test_contradictions_are_refused(old: str, new: str, words: str) -> None:
    assert words in str(error_of_zip(zipped(files(old=old, new=new))))


def test_a_wing_without_rods_must_not_list_rods() -> None:
    raw = with_yaml("  name: falcon\n", "  name: falcon\n  structure: sheet\n")
    message = str(error_of_zip(zipped(raw)))
    assert "wing.rods: a wing with 'structure: sheet' has no rods; remove rods, or remove structure" in message
    assert "wing.driven_rods" in message
    assert "phase_lag_deg: is 3" in message
