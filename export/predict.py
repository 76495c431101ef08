"""The exported model in this process: the same predictions as those of an exported file."""

from __future__ import annotations

from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.runtime.vehicle import VehicleModel
from wingfit.export.runtime.wing import WingModel
from wingfit.records import Wing
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing


def predictor(model: CalibratedModel) -> VehicleModel | WingModel:
    """Return the model as an exported file has it; ValueError for a rig with a simulation of the user's own."""
    if isinstance(model.rig, Wing):
        settings = model.settings
        return WingModel(
            model.rig, settings.division, settings.bounds_factor, settings.accuracy, settings.effects, model.calibrated
        )
    own = model.simulation()
    if not isinstance(own, BladeElementWing):
        raise TypeError("a vehicle is simulated by blade elements")
    return VehicleModel(
        own.vehicle, own.terms, own.elements, own.instants, own.peel_width, own.effects, model.calibrated
    )
