"""The door to UM-Bridge: a real server on loopback, and how it fails."""

from __future__ import annotations

import pickle
import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tests.rigs.doors.oscillator import CHANNELS, NOMINAL, dataset, largest_difference, oscillate, rig, run
from tests.rigs.doors.um_bridge_server import MODEL, Server, serving
from wingfit.diagnosis.rig_check import check_rig
from wingfit.rigs.doors import um_bridge as module
from wingfit.rigs.doors.door import DoorError
from wingfit.rigs.doors.um_bridge import um_bridge
from wingfit.rigs.run import SimulationError

INPUTS = [["stiffness", "damping"], ["mass", "start"]]
OUTPUTS = ["position", "speed", None]


@pytest.fixture
def server() -> Iterator[Server]:
    with serving() as one:
        yield one


def door(server: Server, **options: Any) -> Any:
    given: dict[str, Any] = {"url": server.url, "model": MODEL, "inputs": INPUTS, "outputs": OUTPUTS}
    return um_bridge(**(given | options))


def test_a_server_gives_exactly_what_the_python_function_gives(server: Server) -> None:
    assert largest_difference(door(server)) == 0.0
    assert largest_difference(door(server), ("clock", "delay.force")) == 0.0


def test_channels_may_follow_each_other_in_one_vector(server: Server) -> None:
    server.layout = "joined"
    assert largest_difference(door(server, outputs=[["position", "speed"]])) == 0.0
    with pytest.raises(DoorError, match=r"sizes \[202\], outputs needs \[101, 101\] for 101 times"):
        door(server, outputs=["position", "speed"])(NOMINAL, run())


def test_the_server_is_checked_once_for_each_number_of_times(server: Server) -> None:
    simulate = door(server)
    for _ in range(3):
        simulate(NOMINAL, run())
    simulate(NOMINAL, run(np.linspace(0.0, 1.0, 11)))
    counts = {path: server.asked.count(path) for path in server.asked}
    assert counts == {"/Info": 2, "/ModelInfo": 2, "/InputSizes": 2, "/OutputSizes": 2, "/Evaluate": 4}


def test_it_keeps_the_contract_of_a_rig(server: Server) -> None:
    outcomes = {one.name: (one.outcome, one.words) for one in check_rig(rig(door(server)), dataset())}
    assert {outcome for outcome, _ in outcomes.values()} == {"pass"}, outcomes


@pytest.mark.parametrize(
    ("stiffness", "reason"),
    [
        (50.5, "failed with status 500: Internal Server Error: the spring breaks"),
        (52.5, "did not answer within 0.5 s"),
        (53.5, "is not finite"),
    ],
)
def test_a_simulation_that_fails_is_a_reason_for_one_individual(server: Server, stiffness: float, reason: str) -> None:
    simulate = door(server, timeout=0.5)
    with pytest.raises(SimulationError, match=reason):
        simulate(NOMINAL | {"stiffness": stiffness}, run())
    simulate(NOMINAL, run())


@pytest.mark.parametrize(
    ("changed", "remedy"),
    [
        ({"model": "wing"}, "has no model 'wing'; it has oscillator, other"),
        ({"inputs": [["stiffness", "damping", "mass", "start"]]}, r"takes input vectors of sizes \[2, 2\]"),
        ({"outputs": ["position"]}, r"returns output vectors of sizes \[101, 101, 1\], outputs needs \[101\]"),
        ({"outputs": ["position", "speed", "power"]}, r"outputs needs \[101, 101, 101\]"),
        (
            {"inputs": [["stiffness", "dumping"], ["mass", "start"]]},
            "'dumping' is neither a gene of the rig nor a setting",
        ),
    ],
)
def test_a_wrong_layout_ends_the_diagnosis(server: Server, changed: dict[str, Any], remedy: str) -> None:
    with pytest.raises(DoorError, match=remedy):
        door(server, **changed)(NOMINAL, run())


def test_a_server_that_breaks_the_protocol_ends_the_diagnosis(server: Server) -> None:
    simulate = door(server)
    with pytest.raises(DoorError, match="refuses Evaluate: InvalidOutput: Model output is not a list of lists!"):
        simulate(NOMINAL | {"stiffness": 51.5}, run())
    with pytest.raises(DoorError, match=r"returned 'speed' with shape \[100\]"):
        simulate(NOMINAL | {"stiffness": 54.5}, run())
    server.version = 0.9
    with pytest.raises(DoorError, match=r"speaks protocol 0\.9"):
        door(server)(NOMINAL, run())
    server.version, server.evaluates = 1.0, False
    with pytest.raises(DoorError, match="cannot be evaluated"):
        door(server)(NOMINAL, run())
    with pytest.raises(DoorError, match="answered with status 404 and 'not found'; give the address of a UM-Bridge"):
        door(server, url=f"{server.url}/elsewhere")(NOMINAL, run())
    with pytest.raises(DoorError, match="answered with status 302"):
        door(server, url=f"{server.url}/moved")(NOMINAL, run())
    assert server.asked[-1] == "/moved/Info", "no redirection is followed"


def test_lost_connections_are_tried_again(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "FIRST_WAIT", 0.01)
    simulate = door(server)
    expected = simulate(NOMINAL, run())
    server.drop, server.away = 2, 2
    found = simulate(NOMINAL, run())
    assert np.array_equal(found["speed"], expected["speed"])
    server.drop = 3
    with pytest.raises(DoorError, match="does not answer, after 3 attempts"):
        door(server, retries=2)(NOMINAL, run())


def test_a_server_may_start_later() -> None:
    with serving() as first:
        port = first.server_port
    url = f"http://127.0.0.1:{port}"
    with pytest.raises(DoorError, match=rf"{url} does not answer, after 1 attempts .*; start the UM-Bridge server"):
        um_bridge(url, MODEL, INPUTS, OUTPUTS, retries=0)(NOMINAL, run())
    late: list[Server] = []

    def start() -> None:
        time.sleep(0.4)
        server = Server(port)
        late.append(server)
        server.serve_forever(0.02)

    thread = threading.Thread(target=start)
    thread.start()
    try:
        found = um_bridge(url, MODEL, INPUTS, OUTPUTS)(NOMINAL, run())
    finally:
        late[0].shutdown()
        thread.join()
        late[0].server_close()
    assert np.array_equal(found["position"], oscillate(NOMINAL, run())["position"])


@pytest.mark.parametrize(
    ("changed", "remedy"),
    [
        ({"url": "file:///etc/passwd"}, "give http or https and a host"),
        ({"url": "localhost:4242"}, "give http or https and a host"),
        ({"url": "http://me:secret@localhost:4242"}, "holds a user name or password"),
        ({"timeout": 0.0}, "positive numbers"),
        ({"inputs": ["stiffness", "damping"]}, "a list of names for each input vector"),
    ],
)
def test_wrong_arguments_are_refused(changed: dict[str, Any], remedy: str) -> None:
    given: dict[str, Any] = {"url": "http://localhost:4242", "model": MODEL, "inputs": INPUTS, "outputs": OUTPUTS}
    with pytest.raises(DoorError, match=remedy) as raised:
        um_bridge(**(given | changed))
    assert "secret" not in str(raised.value)


def test_it_can_be_pickled_while_connected(server: Server) -> None:
    simulate = door(server)
    first = simulate(NOMINAL, run())
    copy = pickle.loads(pickle.dumps(simulate))  # noqa: S301
    assert all(np.array_equal(copy(NOMINAL, run())[name], first[name]) for name in CHANNELS)
