"""The door to a program: real programs in Python and C, started once or for every simulation, and how they fail."""

from __future__ import annotations

import os
import pickle
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.rigs.doors.oscillator import CHANNELS, NOMINAL, dataset, largest_difference, oscillate, rig, run
from wingfit.diagnosis.rig_check import check_rig
from wingfit.rigs.doors.command import command
from wingfit.rigs.doors.door import DoorError
from wingfit.rigs.run import SimulationError

ROOT = Path(__file__).parents[3]
PROGRAMS = Path(__file__).parent / "programs"
PROGRAM = PROGRAMS / "oscillator.py"
STIFF = NOMINAL | {"stiffness": 35.0}  # with which the program misbehaves
EXACT = 1e-9  # of the largest value: the programs integrate with fourth order
BOTH = pytest.mark.parametrize("persistent", [False, True], ids=["one process each", "persistent"])


def door(way: str = "well", persistent: bool = False, **options: Any) -> Any:
    lines = ["lines"] if persistent else []
    return command([sys.executable, PROGRAM, way, *lines], list(CHANNELS), persistent=persistent, **options)


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    gcc = shutil.which("gcc") or shutil.which("cc")
    if gcc is None:
        pytest.skip("there is no C compiler (gcc), with which the program of this test is compiled")
    program = tmp_path_factory.mktemp("program") / "oscillator"
    subprocess.run([gcc, "-O1", "-o", program, PROGRAMS / "oscillator.c"], check=True)
    return program


@BOTH
def test_a_program_gives_what_the_python_function_gives(persistent: bool) -> None:
    assert largest_difference(door(persistent=persistent)) < EXACT


def test_faults_are_laid_over_a_foreign_simulation() -> None:
    effects = ("delay.force", "clock", "gain.position")
    # The program needs inputs at the times of the channels; a delay and another clock keep them there.
    assert largest_difference(door(persistent=True), effects) < EXACT


def test_a_program_in_c_answers_with_csv(compiled: Path) -> None:
    simulate = command([compiled], list(CHANNELS), answer="csv")
    assert largest_difference(simulate) < EXACT
    with pytest.raises(SimulationError, match=r"oscillator ended with exit code 4: stiffness 39.5 N/m is outside"):
        simulate(NOMINAL | {"stiffness": 39.5}, run())


@BOTH
def test_it_keeps_the_contract_of_a_rig(persistent: bool) -> None:
    outcomes = {one.name: (one.outcome, one.words) for one in check_rig(rig(door(persistent=persistent)), dataset())}
    assert {outcome for outcome, _ in outcomes.values()} == {"pass"}, outcomes


@BOTH
@pytest.mark.parametrize(
    ("way", "reason"),
    [
        ("exit", "ended with exit code 3: first line / the spring breaks"),
        ("signal", "ended with signal SIGABRT"),
        ("hang", "did not answer within 1 s: waiting for a child"),
        ("error", "^the spring is too stiff$"),
        ("nan", "speed is not finite from time 8 of 101 on"),
        ("null", "speed is not finite from time 8 of 101 on"),
    ],
)
def test_a_simulation_that_fails_is_a_reason_for_one_individual(way: str, reason: str, persistent: bool) -> None:
    simulate = door(way, persistent, timeout=1.0)
    before = simulate(NOMINAL, run())
    with pytest.raises(SimulationError, match=reason):
        simulate(STIFF, run())
    after = simulate(NOMINAL, run())
    assert all(np.array_equal(before[name], after[name]) for name in CHANNELS)


@BOTH
@pytest.mark.parametrize(
    ("way", "remedy"),
    [
        ("shape", r"'speed' with shape \[100\]; return one value for each of the 101 times"),
        ("nested", r"'speed' with shape \[1, 101\]"),
        ("text", "something other than numbers for 'speed'"),
        ("channel", "no channel 'speed', but position, velocity; return it"),
        ("list", "must write one line of JSON|answered request 2 with"),
        ("banner", "log messages to standard error|answered request 2 with"),
    ],
)
def test_an_answer_of_the_wrong_form_ends_the_diagnosis(way: str, remedy: str, persistent: bool) -> None:
    simulate = door(way, persistent)
    simulate(NOMINAL, run())
    with pytest.raises(DoorError, match=remedy):
        simulate(STIFF, run())


@pytest.mark.parametrize("way", ["id", "quit", "twice"])
def test_answers_of_a_persistent_program_cannot_be_mixed_up(way: str) -> None:
    simulate = door(way, persistent=True)
    simulate(NOMINAL, run())

    def twice() -> None:
        for _ in range(2):
            simulate(STIFF, run())
            time.sleep(0.1)

    with pytest.raises(DoorError, match="line that is read"):
        twice()


def test_a_program_that_is_not_persistent_is_noticed() -> None:
    simulate = command([sys.executable, "-c", "print('{\"id\": 1, \"channels\": {\"position\": []}}')"], ["position"],
                       persistent=True)  # fmt: skip
    with pytest.raises(DoorError, match=r"shape \[0\]"):
        simulate(NOMINAL, run())
    time.sleep(0.2)
    with pytest.raises(DoorError, match="persistent=False"):
        simulate(NOMINAL, run())


def test_a_program_may_write_much_to_its_error_output() -> None:
    simulate = door("chatty", persistent=True)
    for _ in range(3):
        simulate(STIFF, run())


def test_a_program_that_reads_nothing_does_not_block() -> None:
    long = run(np.linspace(0.0, 100.0, 50_001))
    with pytest.raises(SimulationError, match=r"did not answer within 0\.5 s"):
        command(["sleep", "100"], ["position"], timeout=0.5)(NOMINAL, long)
    with pytest.raises(SimulationError, match=r"false ended with exit code 1"):
        command(["false"], ["position"])(NOMINAL, long)


@pytest.mark.parametrize(
    ("program", "remedy"),
    [
        (["no-such-program"], "'no-such-program' cannot be started: No such file or directory; give the path"),
        ([PROGRAM], "cannot be started: Permission denied; .* an interpreter before it"),
    ],
)
def test_a_program_that_cannot_be_started_ends_the_diagnosis(program: list[str], remedy: str) -> None:
    with pytest.raises(DoorError, match=remedy):
        command(program, ["position"])(NOMINAL, run())
    with pytest.raises(DoorError, match=r"there is no folder /nowhere"):
        command(program, ["position"], folder="/nowhere")(NOMINAL, run())


def test_wrong_arguments_are_refused() -> None:
    for wrong, remedy in (
        ({"program": "simulate --fast"}, "give a list of the program and its arguments"),
        ({"program": []}, "give a list of the program"),
        ({"channels": "position"}, "give a list of names"),
        ({"timeout": 0.0}, "positive number of seconds"),
        ({"persistent": True, "answer": "csv"}, "one line of JSON"),
    ):
        arguments: dict[str, Any] = {"program": ["true"], "channels": ["position"]} | wrong
        with pytest.raises(DoorError, match=remedy):
            command(**arguments)


def test_csv_of_the_wrong_form_ends_the_diagnosis() -> None:
    ragged = command(["printf", r"position,speed\n1,2\n3\n"], ["position"], answer="csv")
    with pytest.raises(DoorError, match="line 3 of the CSV has 1 columns, its first line 2 names"):
        ragged(NOMINAL, run())
    with pytest.raises(DoorError, match="no channel 'position', but nothing"):
        command(["true"], ["position"], answer="csv")(NOMINAL, run())
    diverged = command(["printf", r"position\n1\nnan\n"], ["position"], answer="csv")
    with pytest.raises(SimulationError, match="position is not finite from time 2 of 2 on"):
        diverged(NOMINAL, run(np.array([0.0, 1.0])))


def test_it_runs_in_its_folder_with_its_environment(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(
        "import json, os, sys\n"
        "request = json.load(sys.stdin)\n"
        "found = [float(os.environ['OWN'])] * len(request['times'])\n"
        "print(json.dumps({'channels': {name: found for name in request['channels']}}))\n"
    )
    simulate = command([sys.executable, "own.py"], ["position"], folder=tmp_path, environment={"OWN": "2.5"})
    assert set(simulate(NOMINAL, run())["position"]) == {2.5}


@BOTH
def test_it_can_be_pickled_while_a_program_runs(persistent: bool) -> None:
    simulate = door(persistent=persistent)
    first = simulate(NOMINAL, run())
    copy = pickle.loads(pickle.dumps(simulate))  # noqa: S301
    assert all(np.array_equal(copy(NOMINAL, run())[name], first[name]) for name in CHANNELS)
    assert np.allclose(first["position"], oscillate(NOMINAL, run())["position"], atol=1e-9)


@pytest.mark.parametrize("end", ["sys.exit()", "os.kill(os.getpid(), 9)"])
def test_a_program_ends_with_the_process_that_started_it(tmp_path: Path, end: str) -> None:
    noted, own, starter = (tmp_path / name for name in ("pid", "own.py", "starter.py"))
    own.write_text(
        "import json, os, sys\n"
        "open('pid', 'w').write(str(os.getpid()))\n"
        "for line in sys.stdin:\n"
        "    request = json.loads(line)\n"
        "    channels = {'position': request['times']}\n"
        "    print(json.dumps({'id': request['id'], 'channels': channels}), flush=True)\n"
    )
    starter.write_text(
        "import os, sys\n"
        "from tests.rigs.doors.oscillator import NOMINAL, run\n"
        "from wingfit.rigs.doors.command import command\n"
        "simulate = command([sys.executable, 'own.py'], ['position'], persistent=True)\n"
        f"simulate(NOMINAL, run())\n{end}\n"
    )
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, starter], check=False, cwd=tmp_path, env=environment)
    pid, deadline = int(noted.read_text()), time.monotonic() + 10.0
    while Path(f"/proc/{pid}/cmdline").exists() and Path(f"/proc/{pid}/cmdline").read_bytes():  # empty: a zombie
        assert time.monotonic() < deadline, "the program still runs"
        time.sleep(0.02)


def test_no_program_is_left(tmp_path: Path) -> None:
    noted = tmp_path / "pid"
    text = "import os, sys\nopen(sys.argv[1], 'w').write(str(os.getpid()))\nfor _ in sys.stdin: print(flush=True)\n"
    simulate = command([sys.executable, "-c", text, noted], ["position"], persistent=True)
    with pytest.raises(DoorError):
        simulate(NOMINAL, run())
    del simulate
    with pytest.raises(ProcessLookupError):
        os.kill(int(noted.read_text()), 0)
