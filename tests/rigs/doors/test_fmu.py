"""The door to FMUs: an oscillator built from C for FMI 2.0 and 3.0, against its exact form, and how it fails."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.rigs.doors.fmu_built import built
from tests.rigs.doors.oscillator import (
    CHANNELS,
    NOMINAL,
    UNEVEN,
    dataset,
    largest_difference,
    oscillate,
    recording,
    rig,
    run,
)
from wingfit.diagnosis.rig_check import check_rig
from wingfit.rigs.doors import fmu_instance
from wingfit.rigs.doors.door import DoorError
from wingfit.rigs.doors.fmu import fmu
from wingfit.rigs.rig_model import RigModel
from wingfit.rigs.run import SimulationError

PARAMETERS = {"stiffness": "k", "damping": "damping", "start": "start", "mass": "mass"}
EXACT = 1e-9  # of the largest value: the FMU integrates with fourth order, and gets its input exactly
VERSIONS = pytest.mark.parametrize("version", [2, 3])


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Builds each FMU once."""
    folder, known = tmp_path_factory.mktemp("fmu"), dict[Any, Path]()

    def one(*macros: Any, **options: Any) -> Path:
        key = (*macros, *options.items())
        if key not in known:
            known[key] = built(folder, *macros, **options)
        return known[key]

    return one


def door(file: Path, **options: Any) -> Any:
    return fmu(file, list(CHANNELS), PARAMETERS, ["force"], **options)


def test_an_fmu_that_interpolates_its_inputs_gives_the_exact_form(build: Callable[..., Path]) -> None:
    file = build(2, interpolates=True)
    assert largest_difference(door(file)) < EXACT
    assert largest_difference(door(file), times=UNEVEN) < EXACT
    assert largest_difference(door(file), ("clock", "delay.force", "gain.speed")) < EXACT


@VERSIONS
def test_without_that_the_error_falls_with_the_square_of_the_step(build: Callable[..., Path], version: int) -> None:
    errors = [largest_difference(door(build(version), step=step)) for step in (0.02, 0.01, 0.005)]
    assert errors[0] < 1e-3
    assert np.allclose(np.array(errors[:-1]) / errors[1:], 4.0, rtol=0.1), errors
    assert largest_difference(door(build(version), step=0.002), times=UNEVEN) < 3e-5


@VERSIONS
def test_without_an_input_every_step_is_exact(build: Callable[..., Path], version: int) -> None:
    free = run()
    free = type(free)(free.recording, free.times, free.settings, {"force": np.zeros(len(free.times))}, free.times)
    found, exact = fmu(build(version), list(CHANNELS), PARAMETERS)(NOMINAL, free), oscillate(NOMINAL, free)
    for name in CHANNELS:
        assert np.allclose(found[name], exact[name], rtol=0.0, atol=EXACT)


@VERSIONS
def test_an_fmu_that_needs_equal_steps_gets_them(build: Callable[..., Path], version: int) -> None:
    file = build(version, "EVEN")
    assert largest_difference(door(file, step=0.002), times=UNEVEN) < 3e-5
    assert largest_difference(door(file, step=0.002)) < 3e-5
    with pytest.raises(DoorError, match="give a longer step"):
        door(file, step=1e-9)(NOMINAL, run())


@VERSIONS
def test_it_keeps_the_contract_of_a_rig(build: Callable[..., Path], version: int) -> None:
    outcomes = {one.name: (one.outcome, one.words) for one in check_rig(rig(door(build(version))), dataset())}
    assert {outcome for outcome, _ in outcomes.values()} == {"pass"}, outcomes


@VERSIONS
@pytest.mark.parametrize("fault", [(), ("FORGETS",), ("REFUSES",)], ids=["resets", "forgets", "refuses"])
def test_numbers_do_not_depend_on_earlier_simulations(
    build: Callable[..., Path], version: int, fault: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[int] = []
    usual = fmu_instance.Instance.__init__

    def counted(*arguments: Any) -> None:
        made.append(1)
        usual(*arguments)

    monkeypatch.setattr(fmu_instance.Instance, "__init__", counted)
    simulate = door(build(version, *fault))
    others = [NOMINAL | {"start": start} for start in (0.4, -0.2, 0.3)]
    first = simulate(NOMINAL, run())
    for other in others:
        simulate(other, run())
    again = simulate(NOMINAL, run())
    assert all(np.array_equal(first[name], again[name]) for name in CHANNELS)
    assert (len(made) == 1) is (fault == ()), "one instance serves all where it can be reset"


@VERSIONS
@pytest.mark.parametrize(
    ("stiffness", "reason"),
    [
        (48.0, r"fmi.DoStep failed with status 2 \(discard\): the step is too long"),
        (55.0, r"fmi.ExitInitializationMode failed with status 3 \(error\): stiffness is outside the table"),
        (65.0, r"fmi.ExitInitializationMode failed with status 4 \(fatal\): the solver is gone"),
    ],
)
def test_a_simulation_that_fails_is_a_reason_for_one_individual(
    build: Callable[..., Path], version: int, stiffness: float, reason: str
) -> None:
    simulate = door(build(version))
    before = simulate(NOMINAL, run())
    with pytest.raises(SimulationError, match=reason):
        simulate(NOMINAL | {"stiffness": stiffness}, run())
    after = simulate(NOMINAL, run())
    assert all(np.array_equal(before[name], after[name]) for name in CHANNELS)


@VERSIONS
@pytest.mark.parametrize(
    ("given", "remedy"),
    [
        ({"channels": ["angle"]}, r"no variable 'angle'; its outputs are position, speed"),
        ({"channels": ["count"]}, r"'count' of the FMU is Int.*; name an output that is a single (Real|Float64)"),
        ({"parameters": ["stiffness"]}, "no variable 'stiffness'; its parameters are .*k, mass"),
        ({"parameters": {"stiffness": "force"}}, "'force' of the FMU is of causality input; name a parameter"),
        ({"parameters": {"strength": "k"}}, "'strength' is neither a gene of the rig nor a setting"),
        ({"inputs": {"force": "position"}}, "'position' of the FMU is of causality output; name an input"),
        ({"inputs": {"wind": "force"}}, "has no input 'wind', which inputs names; it has force"),
    ],
)
def test_wrong_names_end_the_diagnosis(
    build: Callable[..., Path], version: int, given: dict[str, Any], remedy: str
) -> None:
    arguments: dict[str, Any] = {"channels": list(CHANNELS), "parameters": PARAMETERS} | given
    with pytest.raises(DoorError, match=remedy):
        fmu(build(version), **arguments)(NOMINAL, run())


def test_files_that_cannot_be_used_end_the_diagnosis(build: Callable[..., Path], tmp_path: Path) -> None:
    good = build(2)
    text, empty, other = (tmp_path / name for name in ("text.fmu", "empty.fmu", "other.fmu"))
    text.write_text("no zip")
    with zipfile.ZipFile(empty, "w") as archive:
        archive.writestr("readme", "")
    with zipfile.ZipFile(good) as archive, zipfile.ZipFile(other, "w") as changed:
        changed.writestr("modelDescription.xml", archive.read("modelDescription.xml"))
        changed.writestr("binaries/win64/oscillator.dll", b"")
    for file, remedy in (
        (tmp_path / "none.fmu", "there is no FMU"),
        (text, "it is not a zip file; export the model again"),
        (empty, "cannot be read as an FMU"),
        (other, "it holds code for win64: export it for "),
        (build(2, kind="ModelExchange"), r"is FMI 2\.0, model exchange; export it for co-simulation"),
    ):
        with pytest.raises(DoorError, match=remedy):
            door(file)(NOMINAL, run())


def test_without_fmpy_the_remedy_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fmpy", None)
    with pytest.raises(DoorError, match=r"pip install 'wingfit\[fmu\]'"):
        door(Path("any.fmu"))(NOMINAL, run())
    with pytest.raises(DoorError, match="positive number of seconds"):
        door(Path("any.fmu"), step=0.0)
    with pytest.raises(DoorError, match=r"channels is the text 'angle'"):
        fmu("any.fmu", "angle", PARAMETERS)


@VERSIONS
def test_it_can_be_pickled_with_an_instance(build: Callable[..., Path], version: int) -> None:
    simulate = door(build(version))
    first = simulate(NOMINAL, run())
    copy = pickle.loads(pickle.dumps(simulate))  # noqa: S301
    assert all(np.array_equal(copy(NOMINAL, run())[name], first[name]) for name in CHANNELS)
    one = recording()
    model = RigModel(rig(copy), (one,))
    again = pickle.loads(pickle.dumps(model)).observe([[20.0, 0.3, 0.1]], one)  # noqa: S301
    assert np.array_equal(again.channels[0, :, 0], first["position"])


def test_nothing_stays_in_the_temporary_folder(build: Callable[..., Path], tmp_path: Path) -> None:
    program = (
        "import sys, os; from tests.rigs.doors.test_fmu import door; from tests.rigs.doors.oscillator import *\n"
        "one = door(sys.argv[1]); one(NOMINAL, run()); assert os.listdir(os.environ['TMPDIR'])"
    )
    subprocess.run([sys.executable, "-c", program, build(2)], check=True, env=os.environ | {"TMPDIR": str(tmp_path)})
    assert not list(tmp_path.iterdir())
