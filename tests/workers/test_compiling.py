"""The simulator is compiled once, before the first worker starts, with progress."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from wingfit.sim import warm
from wingfit.workers import compiling

SLOW = "import time\nfor part in (0.25, 0.5, 0.99): print(part, flush=True); time.sleep(0.5)"


def test_a_compiled_simulator_is_known(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(warm, "_marker", lambda: tmp_path / "compiled")
    assert not warm.compiled()
    warm.compile_kernels(print)
    assert warm.compiled()
    (tmp_path / "compiled").write_text("numba 0.1, another processor")
    assert not warm.compiled()


def test_nothing_is_done_for_a_compiled_simulator(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(warm, "compiled", lambda: True)
    monkeypatch.setattr(compiling, "COMMAND", "raise SystemExit(3)")
    said: list[str] = []
    compiling.compile_simulator(said.append, lambda: False)
    assert not said


def test_progress_is_said_with_the_time_that_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(warm, "compiled", lambda: False)
    monkeypatch.setattr(compiling, "COMMAND", SLOW)
    said: list[str] = []
    compiling.compile_simulator(said.append, lambda: False)
    assert [one.split(": ")[1].split(",")[0] for one in said] == ["25%", "50%", "99%"]
    assert all(one.startswith("compiling the simulator, once: ") and one.endswith(" s left") for one in said)


def test_lines_that_are_no_progress_are_ignored(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = "Warning: something", "3 warnings", "0.5", "0.0", "7", "nan", "", "Warning: more"
    printed = f"import time; print({chr(10).join(lines)!r}, flush=True); time.sleep(1)"
    monkeypatch.setattr(warm, "compiled", lambda: False)
    monkeypatch.setattr(compiling, "COMMAND", printed)
    said: list[str] = []
    compiling.compile_simulator(said.append, lambda: False)
    assert len(said) == 1
    assert said[0].startswith("compiling the simulator, once: 50%, about ")


def test_it_ends_when_the_service_stops(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(warm, "compiled", lambda: False)
    monkeypatch.setattr(compiling, "COMMAND", "import time; time.sleep(60)")
    began = time.monotonic()
    compiling.compile_simulator(print, lambda: True)
    assert time.monotonic() - began < 30


def test_a_failure_is_logged_and_the_workers_start(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(warm, "compiled", lambda: False)
    monkeypatch.setattr(compiling, "COMMAND", "raise SystemExit(3)")
    compiling.compile_simulator(print, lambda: False)
    assert "ended with 3; the workers compile for themselves" in caplog.text
