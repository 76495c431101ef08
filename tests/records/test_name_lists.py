"""A text where a list of names belongs is refused, and so is anything but a rig where a rig belongs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import wingfit
from wingfit import CalibrationSpec, DiagnosisSpec, Gene, Suspect
from wingfit.rigs.load import load_rig

FOLDER = Path(__file__).parents[2] / "examples" / "pendulum"


@pytest.mark.parametrize(
    ("make", "name"),
    [
        *((CalibrationSpec, name) for name in ("recordings", "genes", "without", "axes", "effects")),
        *((DiagnosisSpec, name) for name in ("suspects", "axes")),
    ],
)
def test_a_name_alone_is_no_list_of_names(make: Any, name: str) -> None:
    assert getattr(make(**{name: ("x",)}), name) == ("x",)
    with pytest.raises(TypeError, match=rf"^{name} is the text 'x'; give a sequence of names: \('x',\)$"):
        make(**{name: "x"})


def test_a_text_is_no_mapping_of_names_to_values() -> None:
    wrong: Any = "stiffness"
    with pytest.raises(TypeError, match=r"^fixed is 'stiffness'; give a mapping of names to values, such as"):
        CalibrationSpec(fixed=wrong)
    with pytest.raises(TypeError, match=r"^typical is 'stiffness'; give a mapping"):
        Suspect("friction", genes=(Gene("friction", "N", 0.0, 0.0, 1.0),), typical=wrong)
    with pytest.raises(TypeError, match=r"^size_genes is the text 'stiffness'"):
        Suspect("friction", genes=(Gene("friction", "N", 0.0, 0.0, 1.0),), size_genes=wrong)


def test_held_out_recordings_are_a_list() -> None:
    series: Any = wingfit.load_dataset(FOLDER)
    with pytest.raises(TypeError, match="held_out is the text 'swing-5'"):
        replace(series, held_out="swing-5")


@pytest.mark.parametrize("use", [wingfit.calibrate, wingfit.diagnose])
def test_the_path_of_a_rig_is_no_rig(use: Any) -> None:
    series, file = wingfit.load_dataset(FOLDER), FOLDER / "rig.py"
    for wrong in (str(file), file):
        with pytest.raises(TypeError, match=r"rig is a (str|PosixPath); give a wingfit\.Rig"):
            use(series, rig=wrong)
    assert load_rig(str(file)).name == "pendulum"
