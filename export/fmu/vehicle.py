"""What an FMU of a vehicle is made of: the memory of its model, its compiled functions and its variables."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import carray, types

from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.fmu.conditions import inputs_of, parameters_of, reference_condition
from wingfit.export.fmu.correction import Correction, correction_of
from wingfit.export.fmu.kernels import board as places
from wingfit.export.fmu.kernels import vehicle_step as step
from wingfit.export.fmu.kernels import views
from wingfit.export.fmu.kernels.vehicle_step import FIXED, Parts, run_vehicle
from wingfit.export.fmu.memory import Memory
from wingfit.export.fmu.native import Exported
from wingfit.export.fmu.product import Product
from wingfit.export.fmu.variables import EXTRAPOLATE, SMOOTHING, Variable, output
from wingfit.export.fmu.vehicle_laws import DirectVehicle
from wingfit.records import PassivePitch
from wingfit.records.array_types import Array, Complex
from wingfit.sim.effects.ports.vehicle import VehicleScene
from wingfit.sim.kernels import LANES
from wingfit.sim.vehicle.blade_element_wing import ADDED_MASS_POINT
from wingfit.sim.vehicle.elements import CURVE_ROWS, ROWS
from wingfit.sim.vehicle.rows import ROW_COUNT, mirrored, uppers


def vehicle_product(model: CalibratedModel) -> Product:
    """Return the parts of an FMU of a vehicle; NotExportedError if a law does not have the form of those of an FMU."""
    condition = reference_condition(model)
    direct = DirectVehicle(model, condition)
    parts, memory = _parts(direct, correction_of(direct)), Memory()
    changing = (parts.board, parts.rows, parts.found, parts.peel)
    memory.add(changing, changing=True)
    memory.add(parts, changing=False)
    made = memory.text(parts, lambda part: type(part).__name__)
    space: dict[str, Any] = {"Parts": Parts, "carray": carray, "floats": views.floats, "run_vehicle": run_vehicle}
    exec(f"def run(memory, dt):\n    return run_vehicle({made}, dt)\n", space)  # noqa: S102  (numbers and names)
    inputs, limits = inputs_of(model, condition, memory, parts.board)
    parameters = parameters_of(memory, parts.board, EXTRAPOLATE, SMOOTHING)
    return Product(
        memory=memory, addresses=[], laws=[], board=parts.board, limits=limits,
        functions={"wingfit_run": Exported(space["run"], types.int64(types.int64, types.float64))},
        variables=[*inputs, *parameters, *_outputs(memory.word(parts.board.ctypes.data))],
        stop=20.0 / condition.flap_frequency, step=0.0025 / condition.flap_frequency, remark=direct.remark,
    )  # fmt: skip


def _outputs(first: int) -> list[Variable]:
    """The outputs, the board being at the word ``first``. The model has no moments."""
    return [
        output("force.x", first + places.FORCE, "N", "force of the wings on the body along body x, to the nose"),
        output("force.z", first + places.FORCE + 2, "N", "force of the wings on the body along body z, down"),
        output("lift", first + places.LIFT, "N", "lift of the wings in level flight"),
        output("drag", first + places.DRAG, "N", "drag of the wings in level flight; thrust is negative"),
        output("flap_angle", first + places.FRONT_ANGLE, "rad", "flap angle"),
        output("wing_pitch", first + places.WING_PITCH, "rad", "pitch of the wing at the pitch station"),
        output("beat_phase", first + places.TURN, "1", "part of the beat, from 0 to 1"),
    ]


def _parts(direct: DirectVehicle, correction: Correction) -> Parts:
    scene, model = direct.scene, direct.simulation
    _, chord, mass, _ = model._span
    followed = _pitch_series(scene)
    k, psi = np.arange(len(followed)), 2j * np.pi * np.arange(model.instants) / model.instants
    waves = np.exp(psi[:, None] * k) * followed
    rates = np.stack([(waves * (1j * k) ** order).sum(axis=1).real for order in (1, 2)])
    curves = len(CURVE_ROWS) if "steady_curves" in model.terms else 0
    single = np.array([scene.density[0]])
    return Parts(
        board=np.zeros(places.BOARD), fixed=_fixed(direct), flap=_pairs(scene.flap[0]), pitch=_pairs(followed),
        rates=np.ascontiguousarray(rates), r=model._span[0] * scene.length[0], chord=scene.chord[:, None] * chord,
        mass=np.ascontiguousarray(scene.mass_factor[:, None] * mass), density=single, carried=scene.carried.copy(),
        loading=np.ascontiguousarray(scene.loading[:, : len(chord)]), laws=direct.laws, nodes=correction.nodes,
        barycentric=correction.barycentric, counts=correction.counts, table=correction.table,
        rows=np.zeros((1, ROW_COUNT, 1, LANES)), found=np.zeros((1, len(ROWS) + curves, 2, 1, LANES)),
        peel=np.array([-1.0, 0.0, 0.0]),
    )  # fmt: skip


def _pairs(series: Complex) -> Array:
    return np.ascontiguousarray(np.stack([series.real, series.imag], axis=1))


def _pitch_series(scene: VehicleScene) -> Complex:
    """Fourier series [K + 1] of the angle that the wing's pitch follows, late by the error of its phase."""
    pitch = scene.setting.motion.pitch
    series = scene.flap[0] if isinstance(pitch, PassivePitch) else np.asarray(pitch.series)
    return np.asarray(series * np.exp(-2j * np.pi * np.arange(len(series)) * scene.pitch.lag[0]))


def _fixed(direct: DirectVehicle) -> Array:
    """The numbers of a vehicle that do not change, in the order of :mod:`wingfit.export.fmu.kernels.vehicle_step`."""
    scene, model = direct.scene, direct.simulation
    vehicle, motion, pitch = model.vehicle, scene.setting.motion, scene.setting.motion.pitch
    r, width = model._span[0], model._span[3]
    found, reach = np.zeros(FIXED), motion.pitch_station * vehicle.span
    found[[step.THICKNESS, step.WIDTH, step.POINT]] = vehicle.thickness, width * scene.length[0], ADDED_MASS_POINT
    found[[step.TWIST, step.TWIST_STEP, step.ROOT]] = r[0] / reach, width / reach, motion.root_pitch
    found[[step.DIHEDRAL_COSINE, step.DIHEDRAL_SINE]] = np.cos(vehicle.dihedral), np.sin(vehicle.dihedral)
    found[[step.MIRRORED, step.PRINTED]] = mirrored(vehicle), float(vehicle.velocities == "printed")
    found[[step.CROSSED, step.CLAPS]] = float(len(uppers(vehicle)) > 1), float(vehicle.claps)
    found[[step.PEEL_END, step.PEEL_WIDTH]] = motion.peel_end, model.peel_width
    found[[step.PEELS, step.TOGETHER]] = float("clap_and_peel" in model.terms), scene.together[0]
    found[[step.SPEED_FACTOR, step.INCIDENCE_FACTOR, step.INCIDENCE_ZERO]] = direct.stream
    found[step.INSTANTS] = model.instants
    if isinstance(pitch, PassivePitch):
        own = {"C_theta0": pitch.constant, "C_theta1": pitch.flap, "C_theta2": pitch.flap_rate}
        own["C_theta3"] = pitch.flap_rate_squared
        c = [float(scene.genes[name][0]) if name in scene.genes else value for name, value in own.items()]
        found[[step.PASSIVE, step.C0, step.C1, step.C2, step.C3]] = 1.0, np.pi / 2 + c[0], *c[1:]
        found[step.REST] = np.pi / 2 + c[0]
    else:
        found[step.REST] = pitch.series[0].real
    found[[step.PART, step.ZERO]] = scene.pitch.part[0], scene.pitch.zero[0]
    return found
