from __future__ import annotations

import pytest

from benchmarks.calibration import gene_table
from benchmarks.common.machine import commit, cpu
from wingfit.calibration.result import GeneResult, Result
from wingfit.records import Gene, Genome


def gene(name: str, best: float) -> GeneResult:
    return GeneResult(name, "1", "", best, best, 0.0, 10.0, True, 0.01, True)


def test_deviation_from_the_truth_compares_normalised_shares() -> None:
    result = Result((gene("L_a", 2.2), gene("L_1", 0.75), gene("L_2", 0.25)), (), 1.0, 1.0, None, None, None)
    genes = tuple(
        Gene(n, "1", 2.0, 0.1, 10.0, "log", "", share) for n, share in (("L_a", None), ("L_1", "L"), ("L_2", "L"))
    )
    rows = gene_table(result, Genome(genes, (2.0, 6.0, 2.0)))
    assert [row["error_percent"] for row in rows] == pytest.approx([10.0, 0.0, 0.0])


def test_the_machine_has_a_name() -> None:
    assert cpu()
    assert isinstance(commit(), str)
