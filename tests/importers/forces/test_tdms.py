"""Forces from TDMS files; all but one test are skipped without the optional library npTDMS."""

from __future__ import annotations

import builtins
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.importers.forces.balance_files import BODY, DOWN, FORE, RATE, TIMES, agrees, read, refused


def tdms(*channels: tuple[str, str, Any, dict[str, Any]]) -> bytes:
    """Write channels (group, name, samples, properties)."""
    nptdms: Any = pytest.importorskip("nptdms")
    buffer = io.BytesIO()
    with nptdms.TdmsWriter(buffer) as writer:
        writer.write_segment([nptdms.ChannelObject(*channel) for channel in channels])
    return buffer.getvalue()


STEP = {"wf_increment": 1 / RATE, "unit_string": "mN"}


def test_channels_state_unit_and_rate(tmp_path: Path) -> None:
    raw = tdms(("run", "Fx", 1e3 * FORE, STEP), ("run", "Fz", 1e3 * DOWN, STEP), ("run", "Mx", FORE, {}))
    found = read(tmp_path, raw, "run.tdms", **BODY)
    assert agrees(found)
    assert np.allclose(found.times, TIMES)
    assert ("rate", "500 Hz", "file") in [(one.fact, one.value, one.by) for one in found.statements]
    assert "not imported: Mx" in found.remarks


def test_groups_columns_and_times(tmp_path: Path) -> None:
    channels: list[tuple[str, str, Any, dict[str, Any]]]
    channels = [(group, name, values, {}) for group in ("a", "b") for name, values in (("Fx", FORE), ("Fz", DOWN))]
    raw = tdms(*channels, ("b", "Time (s)", TIMES, {}))
    assert "choose one: --group" in refused(tmp_path, raw, "run.tdms", **BODY)
    assert "--rate-hz" in refused(tmp_path, raw, "run.tdms", group="a", unit="N", **BODY)
    assert agrees(read(tmp_path, raw, "run.tdms", group="b", unit="N", **BODY))
    named = tdms(("a", "ch0", FORE, {}), ("a", "ch1", DOWN, {}))
    assert "--columns 'fx=NAME; fz=NAME' (a: ch0, ch1)" in refused(tmp_path, named, "run.tdms", **BODY)
    options = {"columns": "fx=ch0; fz=ch1", "unit": "N", "rate_hz": RATE}
    assert agrees(read(tmp_path, named, "run.tdms", **options, **BODY))


def test_damaged_files_are_refused(tmp_path: Path) -> None:
    raw = tdms(("run", "Fx", FORE, STEP), ("run", "Fz", DOWN, STEP))
    assert "different lengths" in refused(
        tmp_path, tdms(("r", "Fx", FORE, STEP), ("r", "Fz", DOWN[:9], STEP)), "a.tdms"
    )
    assert "not numbers" in refused(tmp_path, tdms(("r", "Fx", np.array(["a", "b"] * 9), {})), "a.tdms")
    rng = np.random.default_rng(5)
    for _ in range(60):
        broken = bytearray(raw)
        for at in rng.integers(4, len(raw), 3):
            broken[at] = rng.integers(256)
        try:
            read(tmp_path, bytes(broken), "run.tdms", **BODY)
        except ValueError as error:  # DatasetError is one; anything else fails the test
            assert type(error).__name__ == "DatasetError"  # noqa: PT017


def test_without_the_library_the_error_says_how_to_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usual = builtins.__import__

    def missing(name: str, *rest: Any, **more: Any) -> Any:
        if name.startswith("nptdms"):
            raise ImportError(name)
        return usual(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", missing)
    message = refused(tmp_path, b"TDSm\x0e\x00\x00\x00", "run.tdms", **BODY)
    assert "wingfit[tdms]" in message
    assert "CSV" in message
