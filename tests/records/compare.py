"""Bit-exact comparison of datasets."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import fields, is_dataclass

import numpy as np

from wingfit.records import AnyDataset


def fingerprint(value: object) -> object:
    """``value`` with every float as its bits, so that 0.0 differs from -0.0; a missing sample is any NaN."""
    if isinstance(value, np.ndarray):
        filled = np.where(np.isnan(value), np.nan, value)
        return value.shape, str(value.dtype), filled.tobytes()
    if isinstance(value, float):
        return struct.pack("<d", value)
    if isinstance(value, Mapping):
        return {key: fingerprint(item) for key, item in value.items()}
    if isinstance(value, tuple):
        return tuple(fingerprint(item) for item in value)
    if is_dataclass(value):
        return type(value).__name__, {f.name: fingerprint(getattr(value, f.name)) for f in fields(value)}
    return value


def assert_same(a: AnyDataset, b: AnyDataset) -> None:
    assert fingerprint(a) == fingerprint(b)
