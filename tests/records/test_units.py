"""Every double survives the way to the file and back, in every unit."""

from __future__ import annotations

import math
import struct
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from wingfit.records.description.yaml_text import read_yaml, write_yaml
from wingfit.records.units import CELSIUS, DEG, MBAR, SI, Unit, from_si, number_text, to_si

UNITS = {"si": SI, "deg": DEG, "mbar": MBAR, "celsius": CELSIUS}
finite = st.floats(allow_nan=False, allow_infinity=False)


def bits(value: float) -> bytes:
    return struct.pack("<d", value)


@given(finite, st.sampled_from(["si", "deg", "mbar"]))
@example(-0.0, "deg")
@example(5e-324, "deg")
@example(1.7976931348623157e308, "deg")
@example(1e-320, "mbar")
def test_any_double_returns_bit_for_bit(value: float, name: str) -> None:
    written = number_text(from_si(value, UNITS[name]))
    assert bits(to_si(Decimal(written), UNITS[name])) == bits(value)


@given(st.floats(1.0, 1e6))
@example(273.15)
@example(math.nextafter(273.15, 0))
def test_any_temperature_returns_bit_for_bit(kelvin: float) -> None:
    assert bits(to_si(Decimal(number_text(from_si(kelvin, CELSIUS))), CELSIUS)) == bits(kelvin)


@given(st.lists(finite, min_size=1, max_size=5))
def test_numbers_survive_yaml(values: list[float]) -> None:
    text = write_yaml({"a": [from_si(value, DEG) for value in values]})
    back = read_yaml(text.encode(), "f").data["a"]
    assert [bits(to_si(value, DEG)) for value in back] == [bits(value) for value in values]


def test_some_radians_have_no_double_in_degrees() -> None:
    """The reason for decimals: with doubles in degrees the round trip cannot be exact."""
    radians = np.random.default_rng(1).uniform(0.1, 3.1, 300)
    assert any(not _reachable_by_doubles(float(value)) for value in radians)


def _reachable_by_doubles(radians: float) -> bool:
    degrees = float(from_si(radians, DEG))
    near = [degrees, math.nextafter(degrees, math.inf), math.nextafter(degrees, -math.inf)]
    return any(to_si(Decimal(repr(candidate)), DEG) == radians for candidate in near)


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (math.pi, DEG, "180.0"),
        (math.pi / 2, DEG, "90.0"),
        (0.0, DEG, "0.0"),
        (-0.0, DEG, "-0.0"),
        (101325.0, MBAR, "1013.25"),
        (293.15, CELSIUS, "20.0"),
        (273.15, CELSIUS, "0.0"),
        (1e-5, SI, "1.0e-05"),
        (1e22, SI, "1.0e+22"),
    ],
)
def test_people_read_short_numbers(value: float, unit: Unit, text: str) -> None:
    assert number_text(from_si(value, unit)) == text


@given(st.floats(-math.pi, math.pi))
def test_digits_stay_few(radians: float) -> None:
    assert len(from_si(radians, DEG).as_tuple().digits) <= 19


def test_conversion_rounds_once() -> None:
    assert to_si(Decimal("180"), DEG) == math.pi
    assert to_si(Decimal("20"), CELSIUS) == 293.15
