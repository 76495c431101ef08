"""The shapes that annotations name are checked in tests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import TypeCheckError

from tests.records.samples import falcon_dataset
from wingfit.records.files.table import write_table


@pytest.mark.parametrize(
    "wrong",
    [
        {"times": np.arange(11.0)},
        {"values": np.zeros((12, 35))},
        {"values": np.zeros((36, 12))},
        {"standard_deviation": np.ones(12)},
        {"values": np.zeros((12, 36), np.int64)},
    ],
)
def test_a_field_of_a_wrong_shape_is_caught(wrong: dict[str, np.ndarray]) -> None:
    recording = falcon_dataset(12).recordings[0]
    recording = replace(recording, standard_deviation=np.ones(36))
    with pytest.raises(TypeCheckError, match=r"standard_deviation|times|values"):
        replace(recording, **wrong)  # type: ignore[arg-type]


def test_an_argument_of_a_wrong_shape_is_caught() -> None:
    with pytest.raises(TypeCheckError, match="values"):
        write_table(["a"], np.arange(3.0), np.zeros((4, 1)))
