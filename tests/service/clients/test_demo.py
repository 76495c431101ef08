"""The demo with the toy search in place of the wing's: what it prints, how it fails, that it leaves nothing behind."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from examples import demo
from tests.service import toy
from tests.service.processes import ROOT, heed_interrupts

INTERRUPTIBLE = """
import sys
from pathlib import Path
from examples import demo
demo.SERVER = ["tests.service.toy_server", "0.05"]
demo.EXAMPLE = Path(sys.argv[1])
demo.SPEC = {"max_generations": 2000}
sys.exit(demo.main([]))
"""


@pytest.fixture
def example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "toy.zip"
    path.write_bytes(toy.archive())
    monkeypatch.setattr(demo, "SERVER", ["tests.service.toy_server", "0.01"])
    monkeypatch.setattr(demo, "EXAMPLE", path)
    monkeypatch.setattr(demo, "SPEC", {"max_generations": 3, "seed": 1})
    monkeypatch.setattr(demo, "true_values", lambda _: toy.TARGET)
    return path


def _is_gone(url: str) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", urlsplit(url).port or 0)) != 0


@pytest.mark.usefixtures("example")
def test_the_demo_reports_and_leaves_no_server(capsys: pytest.CaptureFixture[str]) -> None:
    assert demo.main([]) == 0
    shown = capsys.readouterr()
    assert "calibrating  100 %" in shown.err
    page = re.search(r"page: (\S+)/#run=run_", shown.out)
    assert page
    assert _is_gone(page[1])
    assert "held out" in shown.out
    assert re.search(r"stiffness\s+1\s+[\d.]+\s+3", shown.out)  # nominal, best, truth
    assert "wingfit serve --data" in shown.out


def test_a_failed_run_fails_the_demo(
    example: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert example.exists()
    monkeypatch.setattr(demo, "SPEC", {"seed": 13})
    assert demo.main([]) == 1
    assert "the thirteenth seed breaks" in capsys.readouterr().err


@pytest.mark.usefixtures("example")
def test_a_server_that_ends_at_once_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(demo, "SERVER", ["tests.service.toy_server"])
    assert demo.main([]) == 1
    assert "IndexError" in capsys.readouterr().err


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_everything(example: Path, how: signal.Signals) -> None:
    running = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTIBLE, str(example)],
        cwd=ROOT,
        env=dict(os.environ),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=heed_interrupts,
    )
    assert running.stdout is not None
    page = ""
    while not page.startswith("page: "):
        page = running.stdout.readline()
        assert page, running.communicate(timeout=60)[1]
    running.send_signal(how)
    _, err = running.communicate(timeout=60)
    assert running.returncode == 130
    assert "Traceback" not in err
    assert _is_gone(page.split()[1])


def test_true_shares_are_normalised(tmp_path: Path) -> None:
    from wingfit.sim.wing.genes import wing_genes

    raw = {gene.name: 0.25 if gene.share_of else gene.nominal for gene in wing_genes({})} | {"L_1": 0.5}
    path = tmp_path / "x.truth.json"
    path.write_text(json.dumps({"division": "11", "genome": raw}))
    values = demo.true_values(path)
    assert values["E_f"] == raw["E_f"]
    assert [values[f"L_{k}"] for k in range(1, 5)] == pytest.approx([0.4, 0.2, 0.2, 0.2])
