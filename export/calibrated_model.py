"""A calibrated model: what a simulation needs, values with their covariance, where they hold, and where they come from.

SI units, angles in rad, as in :mod:`wingfit.records`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from wingfit.calibration.spec import CalibrationSpec, vehicle_model, wing_model
from wingfit.export.runtime.parts import CONDITION_UNITS as CONDITION_UNITS
from wingfit.export.runtime.parts import Calibrated
from wingfit.export.runtime.parts import Covariance as Covariance
from wingfit.export.runtime.parts import FittedRange as FittedRange
from wingfit.export.runtime.parts import FittedRecording as FittedRecording
from wingfit.export.runtime.parts import Parameter as Parameter
from wingfit.export.runtime.parts import Provenance as Provenance
from wingfit.records import Condition, Dataset, Vehicle, Wing
from wingfit.records.dataset import AnyKind
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.wing.flexible_wing import FlexibleWing

SCHEMA = "urn:wingfit:schema:calibrated-model:1"


@dataclass(frozen=True)
class AnyRig:
    """A rig with a simulation of the user's own: how it is found again, and what it records.

    ``plug_in``: name of the installed plug-in, with ``package`` and ``version`` if known; "" for one that its user
    declared and simulates. ``channels`` and ``settings``: units by name.
    """

    name: str
    plug_in: str
    package: str
    version: str
    channels: Mapping[str, str]
    settings: Mapping[str, str]


@dataclass(frozen=True)
class CalibratedModel:
    """A model with everything that is needed to simulate it elsewhere and to judge it.

    Attributes:
        kind: "tracks" (a flexible wing), "forces" (a vehicle) or "series" (any other rig).
        rig: description of the wing, vehicle or rig.
        settings: discretisation, terms, and ``effects`` of the model; ``settings.fixed`` is empty, since
            ``parameters`` has every value. Effects of the measurement are left out: a model that is taken away
            predicts what happens, not what a faulty instrument would show.
        elements, instants: resolution of the blade elements of a vehicle; 0: the default of the simulation.
        parameters: all genes of the model, in its order.
        covariance: of the estimates; None if it is not known (``remarks`` say why).
        misfit, noise: root mean square (forces; series in multiples of the noise) or mean distance (tracks) of the
            fitted recordings, in ``misfit_unit``; None if unknown.
        ranges: where the model was fitted; outside, a prediction is an extrapolation.
        recordings: to which it was fitted.
        remarks: what a user of the model must know.
    """

    kind: AnyKind
    rig: Wing | Vehicle | AnyRig
    settings: CalibrationSpec
    parameters: tuple[Parameter, ...]
    covariance: Covariance | None
    misfit: float | None
    noise: float | None
    misfit_unit: str
    ranges: tuple[FittedRange, ...]
    recordings: tuple[FittedRecording, ...]
    provenance: Provenance
    elements: int = 0
    instants: int = 0
    remarks: tuple[str, ...] = ()
    schema: Literal["urn:wingfit:schema:calibrated-model:1"] = "urn:wingfit:schema:calibrated-model:1"

    @property
    def wing(self) -> Wing:
        """The wing; ValueError for another rig."""
        if not isinstance(self.rig, Wing):
            raise ValueError(f"rig {self.rig.name!r} is no wing: its model has no tracks")
        return self.rig

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle; ValueError for another rig."""
        if not isinstance(self.rig, Vehicle):
            raise ValueError(f"rig {self.rig.name!r} is no vehicle: its model has no blade elements")
        return self.rig

    @property
    def values(self) -> dict[str, float]:
        """Values of all genes by name, without the slopes of a global model."""
        return {one.name: one.value for one in self.parameters}

    def genome(self, condition: Condition) -> tuple[float, ...]:
        """Return the values of all genes under ``condition``, in the order of the model's genes."""
        return tuple(one.at(condition) for one in self.parameters)

    def middle(self) -> Condition:
        """Return the mean of the fitted conditions; ValueError for a rig without conditions."""
        known = [one.condition for one in self.recordings if one.condition is not None]
        if not known:
            raise ValueError(f"rig {self.rig.name!r} has settings instead of conditions of flapping")
        return Condition(**{name: sum(getattr(one, name) for one in known) / len(known) for name in CONDITION_UNITS})

    @property
    def calibrated(self) -> Calibrated:
        """The parts that a copy of the simulation carries."""
        return Calibrated(
            self.rig.name, self.parameters, self.covariance, self.ranges, self.recordings, self.provenance,
            self.misfit, self.noise, self.misfit_unit, self.remarks,
        )  # fmt: skip

    def simulation(self) -> FlexibleWing | BladeElementWing:
        """Return wingfit's own simulation of the model, with the same order of genes; ValueError for any other rig."""
        if isinstance(self.rig, AnyRig):
            raise ValueError(f"rig {self.rig.name!r} is simulated by its own program, not by wingfit")
        dataset = Dataset(self.rig.name, self.rig, ())
        if isinstance(self.rig, Wing):
            return wing_model(dataset, self.settings)
        found = vehicle_model(dataset, self.settings)
        return BladeElementWing(
            found.vehicle, found.terms, self.elements or found.elements, self.instants or found.instants,
            found.peel_width, found.effects,
        )  # fmt: skip
