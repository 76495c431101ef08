"""Kinds of likely mistakes in a dataset, which a dataset can state to have been verified."""

from __future__ import annotations

from typing import Literal

MistakeKind = Literal[
    "air pressure", "air temperature", "airspeed", "amplitude", "axes", "body pitch", "constant channel", "cut",
    "density", "duplicate", "force axes", "force phase", "force unit", "frequency", "frozen marker", "jumps",
    "length unit", "mass", "mean angle", "motion", "origin", "phase lag", "placeholders",
    "pressure and rig", "scale", "side", "swapped markers", "thickness", "tilt", "time unit", "unsteady",
    "vertical sign", "weight",
]  # fmt: skip
