"""Converts simulated loads to JSON answers. Phase 0: the reference markers cross the horizontal on the upstroke."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from wingfit.client import load_answers as answers
from wingfit.client.load_answers import ConnectorLoad, OutputGroups, SectionLoad, Strip
from wingfit.records import Condition
from wingfit.records.blas_threads import one_blas_thread
from wingfit.service.answers import in_si
from wingfit.service.outcomes.requests import OUTPUT_NAMES, ConditionIn, OutputName
from wingfit.service.outcomes.series import rounded
from wingfit.service.units import MM, mm
from wingfit.sim.wing import outputs as sim
from wingfit.sim.wing.outputs import Outputs

Array = npt.NDArray[np.float64]

SIDE = np.array([0.0, 1.0, 0.0])


def wanted(requested: bool | Iterable[OutputName]) -> tuple[OutputName, ...]:
    """Return the names of the outputs that a request selects: True means all of them, False none."""
    if isinstance(requested, bool):
        return OUTPUT_NAMES if requested else ()
    return tuple(dict.fromkeys(requested))


def condition(recorded: Condition, changes: ConditionIn) -> Condition:
    """Return the ``recorded`` condition with the ``changes`` of a request, in SI units."""
    return replace(recorded, **in_si(changes.model_dump(exclude_none=True)))


@one_blas_thread
def outputs(found: Outputs, names: Iterable[OutputName]) -> answers.Outputs:
    """Return the outputs called ``names`` of ``found``, one simulated beat, as the JSON answer, ordered by phase."""
    phase = (found.phase - found.crossing) % 1.0
    order = np.argsort(phase)
    phases = {"phase": phase, "drive_phase": found.phase}
    answer: Any = {name: np.round(values[order], 9).tolist() for name, values in phases.items()}
    if found.solution is not None:
        steps, beats, error = found.solution
        answer["numerics"] = {"steps_per_beat": steps, "beats": beats, "estimated_error_mm": mm(error)}
    for name in names:
        answer.update(_VIEWS[name](found, lambda series: rounded(series[order])))
    return cast(answers.Outputs, answer)


Put = Callable[[Array], list[Any]]


def _motors(found: Outputs, put: Put) -> OutputGroups:
    front, rear = found.motors
    return {
        "motor_angle_deg": {"front": put(np.degrees(front.angle)), "rear": put(np.degrees(rear.angle))},
        "motor_rate_rad_s": {"front": put(front.rate), "rear": put(rear.rate)},
        "motor_torque_n_m": {"front": put(front.torque), "rear": put(rear.torque)},
        "motor_power_w": {"front": put(front.power), "rear": put(rear.power)},
    }


def _air(found: Outputs, put: Put) -> OutputGroups:
    lift, thrust, side = _aerodynamic(found, found.air)
    return {"lift_n": put(lift), "thrust_n": put(thrust), "side_n": put(side)}


def _aerodynamic(found: Outputs, force: Array) -> tuple[Array, Array, Array]:
    """Return lift, thrust and side component, [n] each (n instants), of the ``force`` [n, 3] of the air."""
    return force @ found.lift_axis, force @ found.thrust_axis, force @ SIDE


def _strips(found: Outputs, put: Put) -> OutputGroups:
    def one(strip: sim.Strip) -> Strip:
        lift, thrust, side = _aerodynamic(found, strip.force)
        return {
            "name": strip.name,
            "span_mm": [round(MM * y, 6) for y in strip.span],
            "lift_n": put(lift),
            "thrust_n": put(thrust),
            "side_n": put(side),
            "power_w": put(strip.power),
        }

    return {"strips": [one(strip) for strip in found.strips]}


def _sections(found: Outputs, put: Put) -> OutputGroups:
    def one(section: sim.Section) -> SectionLoad:
        moment, force = put(section.wrench[:, :3]), put(section.wrench[:, 3:])
        return {"name": section.name, "span_mm": round(MM * section.span, 6), "moment_n_m": moment, "force_n": force}

    return {"sections": [one(section) for section in found.sections]}


def _connectors(found: Outputs, put: Put) -> OutputGroups:
    def one(load: sim.ConnectorLoad) -> ConnectorLoad:
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


def _power(found: Outputs, put: Put) -> OutputGroups:
    front, rear = (put(motor.power) for motor in found.motors)
    air, dampers = put(found.air_power), put(-found.dissipated)
    return {"power_w": {"front_motor": front, "rear_motor": rear, "air": air, "dampers": dampers}}


def _energy(found: Outputs, put: Put) -> OutputGroups:
    kinetic, elastic, gravitational = put(found.kinetic), put(found.elastic), put(found.gravitational)
    return {"energy_j": {"kinetic": kinetic, "elastic": elastic, "gravitational": gravitational}}


def _averages(found: Outputs, put: Put) -> OutputGroups:  # noqa: ARG001  (numbers, not series)
    balance = found.balance
    lift, thrust, side = _aerodynamic(found, found.air.mean(axis=0))
    front, rear = (float(np.abs(motor.torque).max()) for motor in found.motors)
    return {
        "averages": {
            "lift_n": float(lift) + 0.0,
            "thrust_n": float(thrust) + 0.0,
            "side_n": float(side),
            "motor_power_w": {"front": balance.front_motor, "rear": balance.rear_motor},
            "peak_motor_torque_n_m": {"front": front, "rear": rear},
            "supplied_w": balance.supplied,
            "dissipated_w": balance.dissipated,
            "to_air_w": balance.to_air + 0.0,  # no negative zero in a vacuum
            "closing_error_w": balance.closing,
            "closing_error_percent": 100.0 * balance.relative_closing,
            "dissipated_by_connector_w": {load.name: float(load.dissipated.mean()) for load in found.connectors},
        }
    }


_VIEWS: Mapping[OutputName, Callable[[Outputs, Put], OutputGroups]] = {
    "motors": _motors,
    "air": _air,
    "strips": _strips,
    "sections": _sections,
    "connectors": _connectors,
    "power": _power,
    "energy": _energy,
    "averages": _averages,
}
