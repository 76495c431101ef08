"""Numbers do not depend on how many individuals a processor computes at a time."""

from __future__ import annotations

import llvmlite.binding as llvm
import numba
import pytest
from llvmlite.binding import FeatureMap

from tests.golden.numbers import CASES, entry
from wingfit.sim.kernels import processor
from wingfit.sim.requested_lanes import VARIABLE


def test_numbers_are_the_same_bits_with_another_number_of_lanes(other_lanes: dict[str, str]) -> None:
    assert {name: entry(CASES[name]())["sha256"] for name in other_lanes} == other_lanes


@pytest.mark.parametrize(
    ("host", "asked", "lanes"),
    [
        ({"avx2": True, "avx512f": True}, None, 8),
        ({"avx2": True, "avx512f": False}, None, 4),
        ({"neon": True}, None, 4),
        ({"avx2": True, "avx512f": True}, "+avx2,+fma,-avx512f", 4),
        ({"avx2": True}, "+avx2,+avx512f", 8),
        ({"avx512f": True}, "", 4),
    ],
)
def test_as_many_as_fit_the_registers_for_which_numba_compiles(
    monkeypatch: pytest.MonkeyPatch, host: dict[str, bool], asked: str | None, lanes: int
) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setattr(llvm, "get_host_cpu_features", lambda: FeatureMap(host))
    monkeypatch.setattr(numba.config, "ENABLE_AVX", True)
    monkeypatch.setattr(numba.config, "CPU_FEATURES", asked)
    assert processor.lanes() == lanes


def test_without_avx_in_numba_or_a_known_processor_there_are_four(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setattr(numba.config, "CPU_FEATURES", None)
    monkeypatch.setattr(llvm, "get_host_cpu_features", lambda: FeatureMap(avx2=True, avx512f=True))
    monkeypatch.setattr(numba.config, "ENABLE_AVX", False)
    assert processor.lanes() == 4

    def unknown() -> FeatureMap:
        raise RuntimeError("failed to get host cpu features")

    monkeypatch.setattr(llvm, "get_host_cpu_features", unknown)
    monkeypatch.setattr(numba.config, "ENABLE_AVX", True)
    assert processor.lanes() == 4


@pytest.mark.parametrize("value", ["0", "3", "16", "eight", "-4", "4.0"])
def test_another_number_is_refused(monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    monkeypatch.setenv(VARIABLE, value)
    with pytest.raises(ValueError, match=f"WINGFIT_LANES is '{value}'; it must be one of 2, 4, 8, or unset"):
        processor.lanes()
