"""No change of structure moves a number: to the bit where the golden file knows the machine, else to 1e-7."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.golden.numbers import CASES, ELSEWHERE, FILE, KNOWN_MACHINES_ONLY, entry, machine

GOLDEN = json.loads(FILE.read_text())


@pytest.mark.parametrize("name", CASES)
def test_numbers_are_those_of_the_golden_file(name: str) -> None:
    now = entry(CASES[name]())
    for known, cases in GOLDEN.items():
        if name in cases and name not in KNOWN_MACHINES_ONLY:
            assert now["count"] == cases[name]["count"]
            tolerance = ELSEWHERE.get(name, 1e-7)
            np.testing.assert_allclose(now["values"], cases[name]["values"], rtol=tolerance, atol=1e-12, err_msg=known)
    here = GOLDEN.get(machine(), {})
    if name in here:
        assert now["sha256"] == here[name]["sha256"]
