"""``wingfit datasets check``: what it prints, how it ends, and the corrected copy."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from wingfit.cli import datasets
from wingfit.client.transport import WingfitError
from wingfit.service.runs.simulation_hints import with_remedy

ROBIRD = Path(__file__).parents[2] / "examples" / "robird"


def light(folder: Path) -> Path:
    """The example with a foam that is lighter than air."""
    shutil.copytree(ROBIRD, folder)
    file = folder / "dataset.yaml"
    file.write_text(file.read_text(encoding="utf-8").replace("foam_density_kg_m3: 30.0", "foam_density_kg_m3: 0.03"))
    return folder


def test_a_certain_mistake_is_an_error_and_names_the_copy(tmp_path: Path) -> None:
    with pytest.raises(WingfitError) as raised:
        datasets.check(light(tmp_path / "light"))
    assert "--fix NEW_FOLDER" in str(raised.value)
    assert "wing.materials.foam_density_kg_m3: 0.03 -> 30" in str(raised.value)


def test_fix_writes_a_copy_that_passes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    datasets.check(light(tmp_path / "light"), tmp_path / "fixed")
    assert "changed dataset.yaml, wing.materials.foam_density_kg_m3: 0.03 -> 30" in capsys.readouterr().out
    datasets.check(tmp_path / "fixed")
    assert "is valid" in capsys.readouterr().out
    with pytest.raises(WingfitError, match="nothing is overwritten"):
        datasets.check(tmp_path / "light", tmp_path / "fixed")


def test_a_copy_is_not_written_into_the_dataset_nor_where_nothing_can_be_written(tmp_path: Path) -> None:
    source = light(tmp_path / "light")
    before = sorted(source.rglob("*"))
    with pytest.raises(WingfitError, match=r"no corrected copy was written.*\n.*is inside .*choose a new name outside"):
        datasets.check(source, source / "fixed")
    assert sorted(source.rglob("*")) == before
    (tmp_path / "file").write_text("no folder", encoding="utf-8")
    with pytest.raises(WingfitError, match=r"cannot be written: Not a directory; choose a folder"):
        datasets.check(source, tmp_path / "file" / "fixed")


def test_all_errors_are_counted_where_only_some_are_listed(tmp_path: Path) -> None:
    source = tmp_path / "unfilled"
    shutil.copytree(ROBIRD, source)
    file = source / "dataset.yaml"
    text, count = re.subn(r"mass_kg: [0-9.e-]+", 'mass_kg: "FILL IN: mass, kg"', file.read_text(encoding="utf-8"))
    file.write_text(text, encoding="utf-8")
    assert count > 20
    with pytest.raises(WingfitError, match=f"{count} errors, of which 20 are listed"):
        datasets.check(source)


def test_a_failed_simulation_points_to_the_checks() -> None:
    assert "wingfit datasets check" in with_remedy("the reference markers never cross the hinge height")
