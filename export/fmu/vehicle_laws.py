"""Which part of a calibrated vehicle an FMU computes directly, and how its coefficients depend on the condition."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from itertools import product

import numpy as np

from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.fmu.conditions import fitted_range
from wingfit.export.fmu.kernels import vehicle_step as step
from wingfit.export.fmu.product import NotExportedError
from wingfit.records import Condition, Recording
from wingfit.records.array_types import Array
from wingfit.sim.effects.contract import Effect
from wingfit.sim.effects.ports.vehicle import ROTATION_POINT, VehicleScene
from wingfit.sim.vehicle.blade_element_wing import _COEFFICIENTS, _ROWS, BladeElementWing
from wingfit.sim.vehicle.elements import CURVE_ROWS, ROWS

_CLOSE = 1e-9  # relative
_FIXED = ("flap", "density", "mass_factor", "loading", "fling", "together", "carried", "length", "chord")


class DirectVehicle:
    """The part of a model that does not depend on the flow of earlier instants, with its coefficients as laws.

    The other effects change the flow with a memory, or the condition in a way of their own: they become a correction
    (:mod:`wingfit.export.fmu.correction`).
    """

    def __init__(self, model: CalibratedModel, condition: Condition) -> None:
        simulation = model.simulation()
        if not isinstance(simulation, BladeElementWing):
            raise NotExportedError(f"{model.rig.name!r} is no vehicle")
        self.model, self.condition, self.simulation = model, condition, simulation
        genome = np.array(model.genome(condition))[None]
        self.on = tuple(e for e in simulation.chosen if e.vehicle and e.on(simulation.genes, genome)[0])
        self.effects = tuple(e for e in self.on if self._is_direct(e))
        self.corrected = tuple(e.name for e in self.on if e not in self.effects)
        self.scene = self.scene_at(condition, self.effects)

    @property
    def remark(self) -> str:
        """What a user of the FMU must know."""
        here = self.condition
        text = (
            f"Air of {here.pressure:.6g} Pa and {here.temperature:.5g} K. Forces of the wings on the body, not "
            "filtered; the model has no moments."
        )
        if self.corrected:
            text += (
                f" The effects {', '.join(self.corrected)} act as in a steady beat under the present inputs: their "
                "flow does not remember earlier inputs, and beyond the fitted range they stay as at its edge."
            )
        return text

    def scene_at(self, condition: Condition, effects: tuple[Effect, ...]) -> VehicleScene:
        """Return the scene of one individual under ``condition`` after the immediate changes of ``effects``."""
        simulation, batch = self.simulation, np.array(self.model.genome(condition))[None]
        genes = simulation._values(batch, simulation._motion_names | _COEFFICIENTS)
        scene = simulation._scene(genes, 1, recording_at(condition))
        for effect in effects:
            if effect.vehicle:
                effect.vehicle(scene, effect.values(simulation.genes, batch))
        return scene

    def forces(self, condition: Condition) -> Array:
        """Return the forces [n, 2] of the whole model over a beat under ``condition``, N."""
        return np.asarray(
            self.simulation.beat(np.array(self.model.genome(condition))[None], recording_at(condition))[0]
        )

    def direct_forces(self, condition: Condition) -> Array:
        """Return the forces [n, 2] over a beat of the part that an FMU computes directly, N."""
        batch = np.array(self.model.genome(condition))[None]
        weights, rows, added = self.simulation._rows_with_effects(self.effects, batch, recording_at(condition))
        return np.asarray((np.einsum("r,ran->an", weights[0], rows[0]) + added[0]).T)

    @cached_property
    def conditions(self) -> tuple[Condition, ...]:
        """Conditions within and beyond the fitted range, under which a law is verified."""
        f, u, a = (fitted_range(self.model, self.condition, name) for name in CONDITION_FIELDS)
        ends = product(_spread(f, 0.1), _spread(u, 0.1), _spread(a, 0.05))
        return tuple(replace(self.condition, flap_frequency=x, airspeed=y, angle_of_attack=z) for x, y, z in ends)

    @cached_property
    def stream(self) -> tuple[float, float, float]:
        """Factor on the airspeed, and factor and constant of the angle of the stream; verified."""
        seen = [self.scene_at(one, self.effects) for one in self.conditions]
        speeds, given = np.array([one.airspeed[0] for one in seen]), np.array([one.airspeed for one in self.conditions])
        angles, pitch = (
            np.array([one.incidence[0] for one in seen]),
            np.array([one.angle_of_attack for one in self.conditions]),
        )
        factor = float(speeds @ given / max(given @ given, 1e-30)) if given.any() else 1.0
        slope, zero = np.linalg.lstsq(np.stack([pitch, np.ones_like(pitch)], axis=1), angles, rcond=None)[0]
        if not (
            np.allclose(factor * given, speeds, rtol=1e-8) and np.allclose(slope * pitch + zero, angles, atol=1e-8)
        ):
            raise NotExportedError("an effect changes the stream in a way that an FMU does not have: export without it")
        return factor, float(slope), float(zero)

    @cached_property
    def laws(self) -> Array:
        """Law [WEIGHTS, LAW] of the factor on the force of each row; see :func:`.kernels.vehicle_step._weight`."""
        f, pitch = (
            np.array([getattr(c, name) for c in self.conditions]) for name in ("flap_frequency", "angle_of_attack")
        )
        basis = np.stack([np.ones_like(f), f, pitch], axis=1)
        seen = np.array([self._weights(self.scene_at(one, self.effects)) for one in self.conditions])
        found = np.zeros((step.WEIGHTS, step.LAW))
        for k, weights in enumerate(seen.T):
            if weights.any():
                found[k] = self._law(weights, basis, k)
        return found

    def _law(self, weights: Array, basis: Array, k: int) -> Array:
        """The law of the ``weights`` [C] of row ``k`` under C conditions: a parameter of the model, times a factor."""
        law = np.zeros(step.LAW)
        law[[step.SIGN, step.LOW, step.HIGH, step.VALUE, step.FACTOR]] = 1.0, -np.inf, np.inf, 1.0, 1.0
        sources = [(law[: step.FACTOR].copy(), np.ones(len(weights)))]
        for one in self.model.parameters:
            values = np.array([one.at(condition) for condition in self.conditions])
            if values.all():
                sources.append((np.array([one.value, one.per_hz, one.per_rad, one.lower, one.upper]), values))
        for own, values in sources:
            ratio = weights / values
            factor = np.linalg.lstsq(basis, ratio, rcond=None)[0]
            factor[np.abs(factor) * np.abs(basis).max(axis=0) < 1e-12 * np.abs(ratio).max()] = 0.0
            if np.allclose(values * (basis @ factor), weights, rtol=1e-8, atol=1e-10 * np.abs(weights).max()):
                sign = -1.0 if ratio.mean() < 0 else 1.0
                law[: step.FACTOR], law[step.FACTOR : step.SIGN], law[step.SIGN] = own, sign * factor, sign
                return law
        raise NotExportedError(
            f"the coefficient of row {(*ROWS, *CURVE_ROWS, 'peel')[k]!r} depends on the condition in a way that an FMU "
            "does not have: export the model without the effect that changes it"
        )

    def _weights(self, scene: VehicleScene) -> Array:
        """Factors [WEIGHTS] on the rows: those of the terms, and of the rows that effects include."""
        turning = ROTATION_POINT - self.simulation.vehicle.pitch_axis
        own = {
            row: float(scene.genes[name][0]) if name else 1.0 for row, (_, name) in _ROWS.items() if row in self._active
        }
        own |= {row: float(scene.genes[name][0]) for row, name in scene.included.items()}
        found = np.array([own.get(row, 0.0) for row in (*ROWS, *CURVE_ROWS)] + [0.0])
        found[step.ROTATION] *= turning
        found[step.PEEL] = -own.get("clap_and_peel", 0.0) - float(scene.fling[0])
        return found

    @property
    def _active(self) -> tuple[str, ...]:
        return self.simulation._active

    def _is_direct(self, effect: Effect) -> bool:
        """Whether an effect changes only what an FMU computes at one instant, alike under every condition."""
        scenes = [self.scene_at(one, (effect,)) for one in (self.condition, *self.conditions)]
        first = scenes[0]
        return not any(
            one._waiting or one.added.any() or one.inflow.any()
            or any(not _alike(getattr(one, name), getattr(first, name), name) for name in _FIXED)
            or any(not np.allclose(x, y) for x, y in zip(one.pitch[:3], first.pitch[:3], strict=True))
            for one in scenes
        )  # fmt: skip


CONDITION_FIELDS = ("flap_frequency", "airspeed", "angle_of_attack")


def recording_at(condition: Condition) -> Recording:
    """Return a recording without values under ``condition``, as the simulation takes it."""
    return Recording("steady", "wind_tunnel", condition, np.zeros(1), (), np.full((1, 2), np.nan), forces=("x", "z"))


def _alike(one: Array, other: Array, name: str) -> bool:
    """Whether an array of two scenes is the same; the coefficient of fling may follow a law."""
    if name == "fling":
        return True
    return one.shape == other.shape and np.allclose(
        one, other, rtol=_CLOSE, atol=_CLOSE * np.abs(other).max(initial=0.0)
    )


def _spread(ends: tuple[float, float], least: float) -> tuple[float, ...]:
    """Three values over a range, that is widened to at least ``least`` of its size."""
    low, high = ends
    half = max(0.5 * (high - low), least * max(abs(high), abs(low), 1.0))
    middle = 0.5 * (low + high)
    return middle - half if middle > half else 0.5 * middle, middle + 0.13 * half, middle + half
