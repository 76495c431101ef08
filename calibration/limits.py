"""Limits of the numbers in the settings of a calibration, the same in a request over HTTP."""

from __future__ import annotations

LARGEST_SEED = 2**53 - 1
WHOLE = {"population": (4, 1000), "stall": (1, 1000), "max_generations": (1, 10_000), "seed": (0, LARGEST_SEED)}
REAL = {"tolerance": (0, 1), "bounds_factor": (1.01, 100)}


def refuse_number(name: str, value: object) -> None:
    """ValueError if ``value`` is not a number within the limits of setting ``name``."""
    least, most = (WHOLE | REAL)[name]
    kinds, what = ((int,), "a whole number") if name in WHOLE else ((int, float), "a number")
    if not isinstance(value, kinds) or isinstance(value, bool):
        raise ValueError(f"{name} is {value!r}; it should be {what}")
    if not value >= least:
        raise ValueError(f"{name} is {value!r}; it should be greater than or equal to {least}")
    if value > most:
        raise ValueError(f"{name} is {value!r}; it should be less than or equal to {most}")
