"""Distance to the planform, the one piece of geometry in the checks."""

from __future__ import annotations

import numpy as np
import pytest

from tests.records.malformed import error_of_zip, with_yaml, zipped
from wingfit.records.description.consistency import distance_outside

# Leading edge x = 0, trailing edge notched at y = 0.5: corners root to tip and back.
NOTCHED = np.array([[0.0, 0.0], [0.0, 0.5], [0.0, 1.0], [1.0, 1.0], [0.2, 0.5], [1.0, 0.0]])


@pytest.mark.parametrize(
    ("x", "y", "distance"),
    [
        (0.1, 0.5, 0.0),
        (0.9, 0.98, 0.0),
        (-0.3, 0.5, 0.3),
        (0.5, -0.2, 0.2),
        (1.3, 1.4, 0.5),
        # In the notch: distance to the slanted edge, not along the chord.
        (0.6, 0.5, 0.4 * 0.5 / np.hypot(0.8, 0.5)),
    ],
)
def test_distance_to_the_planform(x: float, y: float, distance: float) -> None:
    assert distance_outside(NOTCHED, x, y) == pytest.approx(distance, abs=1e-12)


def test_the_margin_is_one_centimetre() -> None:
    good = "x_m: 0.025, y_m: 0.46"
    for y, said in ((0.5101, "10.1 mm outside"), (0.5115, "11.5 mm outside")):
        assert said in str(error_of_zip(zipped(with_yaml(good, f"x_m: 0.025, y_m: {y}"))))
    # Within the margin the marker passes, and only the deliberate second mistake is left.
    files = with_yaml(good, "x_m: 0.025, y_m: 0.5099")
    files["dataset.yaml"] = files["dataset.yaml"].replace(b"held_out: [vacuum-3hz", b"held_out: [nothing")
    assert error_of_zip(zipped(files)).count == 1
