from __future__ import annotations

import pytest

from benchmarks.calibration import gene_table, share_group
from benchmarks.machine import commit, cpu
from calibration.result import GeneResult, Result


def gene(name: str, best: float) -> GeneResult:
    return GeneResult(name, "1", "", best, best, 0.0, 10.0, True, 0.01, True)


def test_deviation_from_the_truth_compares_normalised_shares() -> None:
    result = Result((gene("L_a", 2.2), gene("L_1", 0.75), gene("L_2", 0.25)), (), 1.0, 1.0, None, None, None)
    rows = gene_table(result, {"L_a": 2.0, "L_1": 6.0, "L_2": 2.0})
    assert [row["error_percent"] for row in rows] == pytest.approx([10.0, 0.0, 0.0])


@pytest.mark.parametrize(("name", "group"), [("L_1", "L"), ("ID_4", "ID"), ("L_a", None), ("E_f", None)])
def test_share_groups(name: str, group: str | None) -> None:
    assert share_group(name) == group


def test_machine_is_named() -> None:
    assert cpu()
    assert isinstance(commit(), str)
