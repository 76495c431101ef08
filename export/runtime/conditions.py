"""Conditions of a prediction: read in the units of users, completed, and refused where the model was not fitted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from wingfit.export.runtime.parts import CONDITION_UNITS, Calibrated, FittedRange
from wingfit.records.dataset import Condition
from wingfit.sim.atmosphere import density

WEATHER = 0.05  # relative difference of air density that is no extrapolation: it differs as much from day to day
ROUNDING = 1e-6  # of the largest value of a range: a condition that was rounded to six digits is still inside


class Setting(NamedTuple):
    """How users give one field of a condition: ``name`` with its unit, SI = factor x given + offset."""

    name: str
    field: str
    unit: str
    meaning: str
    factor: float = 1.0
    offset: float = 0.0


SETTINGS = (
    Setting("flap_frequency_hz", "flap_frequency", "Hz", "beats per second"),
    Setting("airspeed_m_s", "airspeed", "m/s", "speed of the airstream"),
    Setting(
        "angle_of_attack_deg", "angle_of_attack", "deg", "angle of attack; of a vehicle its body pitch", math.pi / 180
    ),
    Setting("phase_lag_deg", "phase_lag", "deg", "lag of the rear driving rod behind the front one", math.pi / 180),
    Setting("pressure_mbar", "pressure", "mbar", "static pressure of the air", 100.0),
    Setting("temperature_c", "temperature", "deg C", "temperature of the air", 1.0, 273.15),
)


class OutsideRangeError(ValueError):
    """The condition lies outside those to which the model was fitted, and extrapolation was not requested."""


def middle(calibrated: Calibrated) -> Condition:
    """Return the mean of the fitted conditions."""
    known = [one.condition for one in calibrated.recordings if one.condition is not None]
    return Condition(**{name: sum(getattr(one, name) for one in known) / len(known) for name in CONDITION_UNITS})


def condition_of(calibrated: Calibrated, given: Mapping[str, float | None], *, extrapolate: bool) -> Condition:
    """Return the condition with the ``given`` values by name (:data:`SETTINGS`); others are the mean of those fitted.

    OutsideRangeError outside the fitted range, unless ``extrapolate``; ValueError for an unknown name, or for a value
    that is not finite or impossible.
    """
    values = {name: getattr(middle(calibrated), name) for name in CONDITION_UNITS}
    known = {one.name: one for one in SETTINGS}
    for name, value in given.items():
        if name not in known:
            raise ValueError(f"unknown condition {name!r}; there are {', '.join(known)}")
        if value is None:
            continue
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise ValueError(f"{name} is {value!r}; it must be a finite number in {known[name].unit}")
        values[known[name].field] = known[name].factor * float(value) + known[name].offset
    found = Condition(**values)
    _refuse_impossible(found)
    outside = outside_of(calibrated.ranges, found)
    if outside and not extrapolate:
        raise OutsideRangeError(
            f"{'; '.join(outside)}: the model was not fitted there. Choose a condition inside, or allow the "
            "extrapolation (extrapolate=True, --extrapolate)"
        )
    return found


def outside_of(ranges: tuple[FittedRange, ...], condition: Condition) -> tuple[str, ...]:
    """Return what of ``condition`` is outside the fitted ``ranges``, in words; pressure and temperature by density."""
    by_name = {one.name: one for one in ranges}
    words = []
    for one in SETTINGS:
        if one.field in ("pressure", "temperature") or one.field not in by_name:
            continue
        low, high = by_name[one.field].low, by_name[one.field].high
        value, slack = getattr(condition, one.field), ROUNDING * max(abs(low), abs(high), 1e-3)
        if not low - slack <= value <= high + slack:
            shown, least, most = (_given(one, x) for x in (value, low, high))
            words.append(f"{one.name} {shown:.6g} is outside [{least:.6g}, {most:.6g}] {one.unit}")
    if {"pressure", "temperature"} <= set(by_name):
        pressure, temperature = by_name["pressure"], by_name["temperature"]
        low, high = density(pressure.low, temperature.high), density(pressure.high, temperature.low)
        rho = density(condition.pressure, condition.temperature)
        if not low * (1 - WEATHER) - 1e-9 <= rho <= high * (1 + WEATHER) + 1e-9:
            words.append(
                f"the air's density {rho:.4g} kg/m^3 (pressure_mbar {condition.pressure / 100:.6g}, temperature_c "
                f"{condition.temperature - 273.15:.4g}) is outside [{low:.4g}, {high:.4g}] kg/m^3, widened by "
                f"{100 * WEATHER:g} %"
            )
    return tuple(words)


def shown(condition: Condition) -> dict[str, float]:
    """Return ``condition`` by the names, and in the units, of :data:`SETTINGS`."""
    return {one.name: _given(one, getattr(condition, one.field)) for one in SETTINGS}


def _given(setting: Setting, value: float) -> float:
    return float((value - setting.offset) / setting.factor)


def _refuse_impossible(condition: Condition) -> None:
    if condition.flap_frequency <= 0:
        raise ValueError(f"flap_frequency_hz is {condition.flap_frequency:g}; it must be above 0 Hz")
    if condition.pressure < 0:
        raise ValueError(f"pressure_mbar is {condition.pressure / 100:g}; it must be at least 0 mbar")
    if condition.temperature <= 0:
        raise ValueError(f"temperature_c is {condition.temperature - 273.15:g}; it must be above -273.15 deg C")
    if condition.airspeed < 0:
        raise ValueError(f"airspeed_m_s is {condition.airspeed:g}; it must be at least 0 m/s")
