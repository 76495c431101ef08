"""What a rig, a suspect and a reference to a rig must be, and the messages where they are not."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.rigs import oscillator
from tests.rigs.oscillator import DRAG, GENES, PORT, RIG, simulate
from wingfit.diagnosis.rig_check import check_rig
from wingfit.records import Gene
from wingfit.rigs.declaration import RigDeclaration, declaration
from wingfit.rigs.load import RigError, load_rig
from wingfit.rigs.rig import Rig
from wingfit.rigs.suspect import Suspect

FILE = """
import wingfit

def simulate(genes, run):
    return {"y": genes["a"] * run.times}

rig = wingfit.Rig("line", [wingfit.Gene("a", "m/s", 1.0, 0.1, 10.0)], {"y": "m"}, simulate)
other = 3
"""


def test_sizes_and_typical_values_have_defaults() -> None:
    assert DRAG.size_genes == ("drag.size",)
    assert DRAG.shape_genes == ("drag.power",)
    assert DRAG.typical == {"drag.size": pytest.approx(0.6), "drag.power": 2.0}
    assert DRAG.title == "drag"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"genes": ()}, "has no gene; give at least one"),
        ({"genes": (Gene("a", "1", 1.0, 0.5, 2.0),)}, "no size gene: one whose nominal value, zero"),
        ({"genes": (Gene("a", "1", 0.0, -1.0, 1.0),), "size_genes": ("b",)}, "has no gene 'b'; it has a"),
        (
            {"genes": (Gene("a", "1", 0.5, -1.0, 1.0),), "size_genes": ("a",)},
            "size gene 'a' of suspect 'x' must be 0 when off, not 0.5",
        ),
    ],
)
def test_a_suspect_that_cannot_be_switched_off_is_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Suspect("x", **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"genes": (), "recording_genes": ()}, "has no gene; give at least one parameter"),
        ({"channels": {}}, "has no channel; give the unit of each"),
        ({"simulate": 3}, "simulate is 3; give a function"),
        ({"genes": (*GENES, GENES[0])}, "has gene 'stiffness' twice"),
        ({"suspects": (DRAG, DRAG)}, "has gene 'drag.size' twice"),
        ({"ports": (PORT, PORT)}, "has port 'slide' twice"),
        ({"ports": (replace(PORT, stiffness="k"),)}, "its stiffness 'k' is no gene of rig 'oscillator'"),
        ({"genes": (*GENES, replace(GENES[0], name="a+b"))}, r"gene 'a\+b'; a name needs"),
        ({"suspects": (replace(DRAG, name="dr\nag"),)}, "suspect 'dr.*rename it"),
        ({"ports": (replace(PORT, name=" "),)}, "port ' '; a name needs"),
        ({"inputs": {"position": "N"}}, "'position' is a channel and an input"),
    ],
)
def test_a_rig_that_contradicts_itself_is_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(RIG, **changes)  # type: ignore[arg-type]


def test_lists_are_accepted() -> None:
    rig = Rig("a", list(GENES), {"position": "m", "speed": "m/s"}, simulate)
    assert rig.genes == GENES


def test_a_rig_is_loaded_from_a_file_and_by_other_processes(tmp_path: Path) -> None:
    path = tmp_path / "my_rig.py"
    path.write_text(FILE)
    rig = load_rig(str(path))
    assert rig.name == "line"
    assert pickle.loads(pickle.dumps(rig)).reference == str(path)  # noqa: S301
    assert load_rig(f"{path}:rig").genes == rig.genes


def test_a_changed_file_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "my_rig.py"
    path.write_text(FILE)
    load_rig(str(path))
    path.write_text(FILE.replace('"line"', '"ramp"'))
    assert load_rig(str(path)).name == "ramp"


@pytest.mark.parametrize(
    ("text", "reference", "message"),
    [
        (None, "{path}", "there is no file .*my_rig.py; give the path"),
        ("rig = 3", "{path}", "holds a int called 'rig'; define there: rig = wingfit.Rig"),
        ("a = 3", "{path}", "holds nothing called 'rig'"),
        (FILE, "{path}:other", "holds a int called 'other'"),
        ("1 / 0", "{path}", "fails when it is run: ZeroDivisionError: division by zero"),
        (None, "no_such_module:rig", "module 'no_such_module' cannot be imported"),
        (None, "plug-in", "there is no rig 'plug-in': give a Python file"),
    ],
)
def test_what_is_no_rig_is_refused(tmp_path: Path, text: str | None, reference: str, message: str) -> None:
    path = tmp_path / "my_rig.py"
    if text is not None:
        path.write_text(text)
    with pytest.raises(RigError, match=message):
        load_rig(reference.format(path=path))


def test_a_loaded_rig_keeps_its_changes_in_other_processes(tmp_path: Path) -> None:
    path = tmp_path / "my_rig.py"
    path.write_text(FILE)
    changed = replace(load_rig(str(path)), faults=False, description="changed")
    again = pickle.loads(pickle.dumps(changed))  # noqa: S301
    assert (again.faults, again.description) == (False, "changed")
    assert callable(again.simulate)


def test_a_replaced_simulation_is_the_one_that_other_processes_run(tmp_path: Path) -> None:
    path = tmp_path / "my_rig.py"
    path.write_text(FILE)
    changed = replace(load_rig(str(path)), simulate=simulate)
    assert pickle.loads(pickle.dumps(changed)).simulate is simulate  # noqa: S301


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"genes": "abc"}, "genes has 'a'"),
        ({"suspects": GENES}, "suspects has Gene"),
        ({"ports": ["slide"]}, "ports has 'slide'"),
        ({"channels": ["position"]}, r"channels is \['position'\]"),
        ({"inputs": "push"}, "inputs is 'push'"),
    ],
)
def test_parts_of_another_type_are_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(TypeError, match=words):
        replace(RIG, **changes)


@pytest.mark.parametrize("use", [declaration, lambda rig: list(check_rig(rig, oscillator.dataset(oscillator.blank())))])
def test_a_path_is_no_rig(use: Callable[[Any], Any]) -> None:
    with pytest.raises(TypeError, match=r"rig is a str; give a wingfit\.Rig"):
        use("my_rig.py")


def test_a_suspect_is_the_same_after_its_declaration() -> None:
    drag = replace(DRAG, confused_with=("friction",), descriptive=True)
    one = RigDeclaration.model_validate(declaration(replace(RIG, suspects=[drag]))).rig()
    assert one.suspects == (drag,)
