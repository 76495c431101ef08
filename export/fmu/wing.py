"""What an FMU of a wing is made of: the memory of its simulation, its compiled functions and its variables."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
from numba import carray, types

from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.fmu.conditions import fitted_range, inputs_of, parameters_of, reference_condition
from wingfit.export.fmu.kernels import board as places
from wingfit.export.fmu.kernels import views
from wingfit.export.fmu.kernels.wing_step import ORDERS, TERMS, Parts, run_wing
from wingfit.export.fmu.memory import Memory, relocated
from wingfit.export.fmu.native import Exported
from wingfit.export.fmu.product import NotExportedError, Product
from wingfit.export.fmu.variables import EXTRAPOLATE, RAMP, SMOOTHING, STEPS, Variable, output, vector
from wingfit.records import Condition
from wingfit.records.array_types import Array
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels import LANES, laws
from wingfit.sim.kernels.arrays import FRAME, STAGES, Lanes, Laws, Setting, State, Trace, Wiring, Work, new_work
from wingfit.sim.solver.scene import at_rest, new_trace
from wingfit.sim.wing.flexible_wing import FlexibleWing

_CLOSE = 1e-9  # relative: what a law of the inputs may differ from the arrays of a scene
_LAW_CLOSE = 1e-4  # the same of a law's parameters: a mirror plane lies at the highest of sampled angles
_LEAST_LAG = 0.05  # rad: the laws hold for phase lags up to this size at least
_CLASSES = (Wiring, Setting, Lanes, Laws, Work, State, Trace, Parts)
_ARGUMENTS = "wiring setting lanes work state trace parts"


def wing_product(model: CalibratedModel, steps: int) -> Product:
    """Return the parts of an FMU of a wing, with at least ``steps`` of time per beat.

    NotExportedError if the wing is rigid, if an effect depends on an input in a way that the FMU does not have, or if
    the wing cannot be simulated under any fitted condition.
    """
    wing, condition = model.simulation(), reference_condition(model)
    if not isinstance(wing, FlexibleWing) or wing.wing.structure == "rigid":
        raise NotExportedError(
            f"{model.rig.name!r} is a rigid wing, whose loads are not computed: describe it as a stiff sheet "
            "(structure: sheet), calibrate, and export that model"
        )
    genome = np.array(model.genome(condition))
    scene = wing.scene(genome, condition)
    lanes, setting = scene.frozen(), scene.setting(steps)
    wiring = scene.structure.wiring
    work = new_work(wiring, setting, lanes)
    state = at_rest(scene.structure, len(lanes.laws.size))
    trace = new_trace(scene.structure, 1, states=len(lanes.laws.size))
    lag = max(map(abs, fitted_range(model, condition, "phase_lag")))
    parts = _parts(_Followed(wing, genome, condition, lag), scene)
    memory = Memory()
    frames = work.strip_frames, work.connector_frames, work.point_frames
    for value in (frames, lanes.laws.strip, lanes.laws.connector, lanes.laws.point):
        memory.add(value, changing=False)
    changing = (parts.board, lanes.laws.parameters, lanes.laws.motor, setting.wind, state)
    memory.add((*changing, trace, parts.profile, parts.angles, parts.alive), changing=True)
    memory.add(work._replace(density=np.zeros(0)), changing=True)
    memory.add((wiring, lanes, setting.density, parts), changing=False)
    values = (wiring, setting, lanes, work, state, trace, parts)
    functions = _functions(memory, values, lanes.laws)
    addresses = [pair for rows in frames for pair in relocated(rows, memory, range(3, FRAME))]
    inputs, limits = inputs_of(model, condition, memory, parts.board)
    fixed = (EXTRAPOLATE, SMOOTHING, RAMP, replace(STEPS, start=float(steps)))
    parameters = parameters_of(memory, parts.board, *fixed)
    parts.board[places.LEAST] = max(min(one.low for one in limits if one.name == "flap_frequency"), 0.1)
    outputs = _outputs(memory, wing, parts.board, trace)
    return Product(
        memory=memory, functions=functions, addresses=addresses, laws=_law_words(memory, lanes.laws, functions),
        board=parts.board, variables=[*inputs, *parameters, *outputs], limits=limits,
        stop=20.0 / condition.flap_frequency, step=0.01 / condition.flap_frequency,
        remark=f"Air of {condition.pressure:.6g} Pa and {condition.temperature:.5g} K, gravity {condition.gravity:g} "
        "m/s^2. The wing starts at rest; its stroke grows over the first beats. Axes: x aft, y outboard, z up.",
    )  # fmt: skip


def _functions(memory: Memory, values: tuple[Any, ...], own: Laws) -> dict[str, Exported]:
    """Functions of the object file by their names: run, and the laws of effects."""
    names = {one.__name__: one for one in _CLASSES}
    texts = [memory.text(value, lambda part: type(part).__name__) for value in values]
    made = "\n".join(f"    {name} = {text}" for name, text in zip(_ARGUMENTS.split(), texts, strict=True))
    source = f"def run(memory, dt):\n{made}\n    return run_wing({', '.join(_ARGUMENTS.split())}, dt)\n"
    space: dict[str, Any] = {
        **names, "carray": carray, "floats": views.floats, "integers": views.integers, "flags": views.flags,
        "run_wing": run_wing,
    }  # fmt: skip
    exec(source, space)  # noqa: S102  (text of numbers and names, made above)
    found = {"wingfit_run": Exported(space["run"], types.int64(types.int64, types.float64))}
    used = {int(row[0]) for rows in (own.strip, own.connector, own.point) for row in rows}
    known = {int(compiled.address): law for law, compiled in laws._COMPILED.items()}
    for k, address in enumerate(sorted(used)):
        found[f"wingfit_law_{k}"] = Exported(known[address], laws.SIGNATURE)
    return found


def _law_words(memory: Memory, own: Laws, functions: dict[str, Exported]) -> list[tuple[int, int]]:
    """Words of the memory that hold the address of a law, each with the law's number."""
    known = {int(compiled.address): law for law, compiled in laws._COMPILED.items()}
    numbers = {function: int(name.rpartition("_")[2]) for name, (function, _) in functions.items() if "law" in name}
    found = []
    for rows in (own.strip, own.connector, own.point):
        found += [(memory.word(row.ctypes.data), numbers[known[int(row[0])]]) for row in rows]
    return found


def _outputs(memory: Memory, wing: FlexibleWing, board: Array, trace: Trace) -> list[Variable]:
    """The outputs: loads on the drive, air, angles, and the coordinates of all markers."""
    first, tracks = memory.word(board.ctypes.data), memory.word(trace.tracks.ctypes.data)
    found = [
        *vector("force", first + places.FORCE, "N", "force of the wing on its drive"),
        *vector("moment", first + places.MOMENT, "N.m", "moment of the wing on its drive, about the hinge"),
        *vector("air_force", first + places.AIR, "N", "force of the air on the wing, without that of added mass"),
        output("front.torque", first + places.FRONT_TORQUE, "N.m", "torque of the motor on the front driving rod"),
        output("rear.torque", first + places.REAR_TORQUE, "N.m", "torque of the motor on the rear driving rod"),
        output("power", first + places.POWER, "W", "power of both motors"),
        output("front.angle", first + places.FRONT_ANGLE, "rad", "flap angle of the front driving rod"),
        output("rear.angle", first + places.REAR_ANGLE, "rad", "flap angle of the rear driving rod"),
        output("beat_phase", first + places.TURN, "1", "part of the beat, from 0 to 1"),
    ]
    for k, marker in enumerate(wing.wing.markers):
        name = marker.name if re.fullmatch(r"[A-Za-z_]\w*", marker.name, re.ASCII) else f"'{marker.name}'"
        for i, axis in enumerate("xyz"):
            place, text = tracks + (3 * k + i) * LANES, f"position of marker {marker.name}"
            found.append(output(f"marker.{name}.{axis}", place, "m", text))
    return found


def _parts(own: _Followed, scene: WingScene) -> Parts:
    """Arrays by which the scene follows the inputs, each verified under other conditions."""
    parameters, motor = own.varying()
    rows = np.flatnonzero(np.any(parameters[1:] != 0.0, axis=(0, 2)))
    columns = 6 if len(scene.motor) else 3
    return Parts(
        board=np.zeros(places.BOARD), series=own.series(), wind=own.wind(), rows=rows.astype(np.int64),
        varying=np.ascontiguousarray(parameters[:, rows]), motor=motor,
        profile=np.zeros((STAGES, 2, columns, LANES)), angles=np.zeros((2, ORDERS)), alive=np.ones(LANES, bool),
    )  # fmt: skip


class _Followed:
    """How the inputs of the kernels depend on the condition, from scenes under several conditions."""

    def __init__(self, model: FlexibleWing, genome: Array, condition: Condition, reach: float) -> None:
        self.condition = replace(condition, airspeed=max(condition.airspeed, 1.0), phase_lag=0.0)
        self.reach = reach
        self.model, self.genome = model, genome
        self.effects = ", ".join(one.name for one in model._switched_on(genome)) or "none"

    def scene_at(self, **changed: float) -> WingScene:
        """Return the scene under the condition with some fields ``changed``."""
        return self.model.scene(self.genome, replace(self.condition, **changed))

    def frozen(self, **changed: float) -> Lanes:
        """Return the inputs of the kernels under the condition with some fields ``changed``."""
        return self.scene_at(**changed).frozen()

    def wind(self) -> Array:
        """Parts [3, 3] of the stream: constant, and by speed along and across the body."""
        still, along, across = (
            self.scene_at(airspeed=u, angle_of_attack=a).wind[:, 0]
            for u, a in ((0.0, 0.0), (1.0, 0.0), (1.0, 0.5 * np.pi))
        )
        found = np.stack([still, along - still, across - still])
        for speed, angle in ((3.0, 0.4), (0.7, -1.1)):
            law = found[0] + speed * (np.cos(angle) * found[1] + np.sin(angle) * found[2])
            self._check("the stream", law, self.scene_at(airspeed=speed, angle_of_attack=angle).wind[:, 0])
        return found

    def series(self) -> Array:
        """Series [2, K + 1, 2] of both rods without lag (real and imaginary parts)."""
        found = self.scene_at(phase_lag=0.0).rods.series[:, :, 0].T
        late = found * np.exp(-0.3j * np.arange(found.shape[1]) * np.array([[0.0], [1.0]]))
        for changed in ({}, {"flap_frequency": 1.7 * self.condition.flap_frequency, "airspeed": 5.0}):
            seen = self.scene_at(phase_lag=0.3, **changed).rods.series[:, :, 0].T
            self._check("the drive", late, seen)
        return np.ascontiguousarray(np.stack([found.real, found.imag], axis=2))

    def varying(self) -> tuple[Array, Array]:
        """Coefficients of the laws' parameters [TERMS, P, W] and of the motor [TERMS, MOTOR, W].

        They are those of one, the flap frequency, and the powers of the phase lag.
        """
        f, order = self.condition.flap_frequency, TERMS - 2
        reach = max(self.reach, _LEAST_LAG)
        nodes = reach * np.cos(np.pi * np.arange(order + 1) / order)
        vander = np.linalg.inv(np.vander(nodes, order + 1, increasing=True))
        found = []
        for kind in ("parameters", "motor"):
            late = np.array([getattr(self.frozen(phase_lag=lag).laws, kind) for lag in nodes])
            one, other = late[order // 2], getattr(self.frozen(flap_frequency=2.0 * f).laws, kind)
            slope = np.where(np.isclose(one, other, rtol=_CLOSE, atol=0.0), 0.0, (other - one) / f)
            powers = np.tensordot(vander, late, axes=1)[1:]
            powers[np.broadcast_to(np.ptp(late, axis=0) <= _CLOSE * np.abs(one), powers.shape)] = 0.0
            constant = np.where(slope == 0.0, one, one - f * slope)
            found.append(np.stack([constant, slope, *powers]))
        self._verify(found)
        return found[0], found[1]

    def _verify(self, found: list[Array]) -> None:
        """Compare the laws with scenes under other conditions, and check that nothing else depends on the inputs."""
        f, first = self.condition.flap_frequency, self.frozen()
        for changed in (
            {"flap_frequency": 0.4 * f}, {"airspeed": 2.7, "flap_frequency": 1.3 * f},
            {"phase_lag": 0.77 * max(self.reach, _LEAST_LAG), "flap_frequency": 0.7 * f}, {"angle_of_attack": 0.6},
        ):  # fmt: skip
            seen, lag = self.frozen(**changed), changed.get("phase_lag", 0.0)
            terms = [1.0, changed.get("flap_frequency", f), *(lag**k for k in range(1, TERMS - 1))]
            for law, values in zip(found, (seen.laws.parameters, seen.laws.motor), strict=True):
                self._check("a law", np.tensordot(terms, law, axes=1), values, _LAW_CLOSE)
            for name in Lanes._fields:
                if name != "laws":
                    self._check(name, getattr(first, name), getattr(seen, name))

    def _check(self, what: str, law: Any, seen: Any, close: float = _CLOSE) -> None:
        size = np.abs(np.asarray(seen)).max(initial=1e-300)
        if not np.allclose(law, seen, rtol=close, atol=close * size):
            raise NotExportedError(
                f"{what} depends on flap frequency, phase lag, airspeed or angle of attack in a way that an FMU does "
                f"not have; effects: {self.effects}: export the model without the effect that does"
            )
