"""Loads from the simulator to the wire: unit suffixes, and the phase of the beat that the tracks have."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from wingfit.records import Condition
from wingfit.records.blas_threads import one_blas_thread
from wingfit.service.outcomes.load_schemas import OUTPUT_NAMES, ConditionIn, OutputName
from wingfit.service.outcomes.series import rounded
from wingfit.service.units import MM, PASCAL_PER_MBAR, ZERO_CELSIUS, mm
from wingfit.sim.wing.outputs import ConnectorLoad, Outputs, Section, Strip

Array = npt.NDArray[np.float64]
Json = dict[str, Any]

SIDE = np.array([0.0, 1.0, 0.0])
# Digits below the largest value of a series that go out: beyond, there is only the integrator's error.


def wanted(asked: bool | Iterable[OutputName]) -> tuple[OutputName, ...]:
    """The outputs that a request names."""
    if isinstance(asked, bool):
        return OUTPUT_NAMES if asked else ()
    return tuple(dict.fromkeys(asked))


_TO_SI: Mapping[str, tuple[str, Callable[[float], float]]] = {
    "flap_frequency_hz": ("flap_frequency", float),
    "phase_lag_deg": ("phase_lag", math.radians),
    "pressure_mbar": ("pressure", lambda mbar: mbar * PASCAL_PER_MBAR),
    "temperature_c": ("temperature", lambda celsius: celsius + ZERO_CELSIUS),
    "airspeed_m_s": ("airspeed", float),
    "angle_of_attack_deg": ("angle_of_attack", math.radians),
}


def condition(recorded: Condition, changes: ConditionIn) -> Condition:
    """The recorded condition with what a request changes, in SI."""
    given = changes.model_dump(exclude_none=True)
    return replace(recorded, **{_TO_SI[name][0]: _TO_SI[name][1](value) for name, value in given.items()})


@one_blas_thread
def outputs(found: Outputs, names: Iterable[OutputName]) -> Json:
    """What was asked for, as plain JSON (`wingfit.service.outcomes.load_schemas.OutputsOut`)."""
    phase = (found.phase - found.crossing) % 1.0
    order = np.argsort(phase)
    answer: Json = {
        "phase": np.round(phase[order], 9).tolist(),
        "drive_phase": np.round(found.phase[order], 9).tolist(),
    }
    if found.solution is not None:
        steps, beats, error = found.solution
        answer["solved"] = {"steps_per_beat": steps, "beats": beats, "estimated_error_mm": mm(error)}
    for name in names:
        answer |= _VIEWS[name](found, lambda series: rounded(series[order]))
    return answer


Put = Callable[[Array], list[Any]]


def _motors(found: Outputs, put: Put) -> Json:
    front, rear = found.motors
    return {
        "motor_angle_deg": {"front": put(np.degrees(front.angle)), "rear": put(np.degrees(rear.angle))},
        "motor_rate_rad_s": {"front": put(front.rate), "rear": put(rear.rate)},
        "motor_torque_n_m": {"front": put(front.torque), "rear": put(rear.torque)},
        "motor_power_w": {"front": put(front.power), "rear": put(rear.power)},
    }


def _aerodynamic(found: Outputs, force: Array, put: Put) -> Json:
    return {
        "lift_n": put(force @ found.lift_axis),
        "thrust_n": put(force @ found.thrust_axis),
        "side_n": put(force @ SIDE),
    }


def _air(found: Outputs, put: Put) -> Json:
    return _aerodynamic(found, found.air, put)


def _strips(found: Outputs, put: Put) -> Json:
    def one(strip: Strip) -> Json:
        head = {"name": strip.name, "span_mm": [round(MM * y, 6) for y in strip.span]}
        return head | _aerodynamic(found, strip.force, put) | {"power_w": put(strip.power)}

    return {"strips": [one(strip) for strip in found.strips]}


def _sections(found: Outputs, put: Put) -> Json:
    def one(section: Section) -> Json:
        head = {"name": section.name, "span_mm": round(MM * section.span, 6)}
        return head | {"moment_n_m": put(section.wrench[:, :3]), "force_n": put(section.wrench[:, 3:])}

    return {"sections": [one(section) for section in found.sections]}


def _connectors(found: Outputs, put: Put) -> Json:
    def one(load: ConnectorLoad) -> Json:
        return {
            "name": load.name,
            "kind": load.kind,
            "between": list(load.between),
            "point_mm": np.round(MM * load.point, 6).tolist(),
            "moment_n_m": put(load.wrench[:, :3]),
            "force_n": put(load.wrench[:, 3:]),
            "angular_velocity_rad_s": put(load.twist[:, :3]),
            "velocity_m_s": put(load.twist[:, 3:]),
            "dissipated_w": put(load.dissipated),
            "stored_j": put(load.stored),
        }

    return {"connectors": [one(load) for load in found.connectors]}


def _power(found: Outputs, put: Put) -> Json:
    front, rear = found.motors
    ports = {"front_motor": front.power, "rear_motor": rear.power, "air": found.air_power, "dampers": -found.dissipated}
    return {"power_w": {name: put(series) for name, series in ports.items()}}


def _energy(found: Outputs, put: Put) -> Json:
    kinds = {"kinetic": found.kinetic, "elastic": found.elastic, "gravitational": found.gravitational}
    return {"energy_j": {name: put(series) for name, series in kinds.items()}}


def _averages(found: Outputs, put: Put) -> Json:  # noqa: ARG001  (numbers, not series)
    balance, air = found.balance, found.air.mean(axis=0)
    front, rear = found.motors
    return {
        "averages": {
            "lift_n": float(air @ found.lift_axis) + 0.0,
            "thrust_n": float(air @ found.thrust_axis) + 0.0,
            "side_n": float(air @ SIDE),
            "motor_power_w": {"front": balance.front_motor, "rear": balance.rear_motor},
            "peak_motor_torque_n_m": {
                "front": float(np.abs(front.torque).max()),
                "rear": float(np.abs(rear.torque).max()),
            },
            "supplied_w": balance.supplied,
            "dissipated_w": balance.dissipated,
            "to_air_w": balance.to_air + 0.0,  # no negative zero in a vacuum
            "closing_error_w": balance.closing,
            "closing_error_percent": 100.0 * balance.relative_closing,
            "dissipated_by_connector_w": {load.name: float(load.dissipated.mean()) for load in found.connectors},
        }
    }


_VIEWS: Mapping[OutputName, Callable[[Outputs, Put], Json]] = {
    "motors": _motors,
    "air": _air,
    "strips": _strips,
    "sections": _sections,
    "connectors": _connectors,
    "power": _power,
    "energy": _energy,
    "averages": _averages,
}
