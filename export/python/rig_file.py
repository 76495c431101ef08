"""Write the calibrated parameters of a rig as one Python file, which is given the simulation by :func:`load`."""

from __future__ import annotations

from pprint import pformat

from wingfit.export.calibrated_model import AnyRig, CalibratedModel
from wingfit.export.python.vehicle_file import LINE, bundled

RUNTIME = "wingfit.export.runtime.rig"


def rig_file(model: CalibratedModel) -> str:
    """Return the text of the Python file of ``model``; ValueError for a wing or a vehicle."""
    rig = model.rig
    if not isinstance(rig, AnyRig):
        raise ValueError(f"rig {rig.name!r} has a simulation of wingfit: take that away")
    found = f"plug-in {rig.plug_in!r} of {rig.package} {rig.version}" if rig.plug_in else "a function of its user"
    calibrated = pformat(model.calibrated, width=LINE, sort_dicts=False)
    return bundled(model, [RUNTIME], (), BODY.format(calibrated=calibrated), ABOUT.format(simulation=found))


ABOUT = """
The simulation is {simulation}; it is not in this file:

    from model import load
    model = load(simulate)                 # simulate(values by name, run) returns channels by name
    found = model(run, recording="first")  # found.channels, found.errors, found.interval(channel)

Settings outside the fitted range are refused, unless extrapolate=True. The file needs Python 3.11 and numpy.
"""

BODY = '''from {{package}}.export.runtime.conditions import OutsideRangeError  # noqa: E402, F401
from {{package}}.export.runtime.parts import (  # noqa: E402, F401
    Calibrated,
    Covariance,
    FittedRange,
    FittedRecording,
    Parameter,
    Provenance,
)
from {{package}}.export.runtime.rig import LoadedRig, Series  # noqa: E402, F401

CALIBRATED = {calibrated}


def load(simulate):
    """Return the calibrated model with the simulation: a function of values by name and of a run."""
    return LoadedRig(simulate, CALIBRATED)
'''
