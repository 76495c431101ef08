"""Compare exported Python with wingfit's own simulation over conditions."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks.export.isolated import FILE_NEEDS, PACKAGE_NEEDS, run, site_of
from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.formats import exported, stem
from wingfit.export.runtime.conditions import shown
from wingfit.records import Condition
from wingfit.records.array_types import Array
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.virtual_rigs.balance import blank_recording as blank_forces
from wingfit.sim.virtual_rigs.campaign import blank_recording as blank_tracks
from wingfit.sim.wing.flexible_wing import FlexibleWing

VEHICLE_CODE = """
import importlib
model = importlib.import_module({name!r}).Model()
found = [model.forces(errors=False, **one).force_n.tolist() for one in json.loads({conditions!r})]
print(json.dumps(found))
"""
WING_CODE = """
import importlib
package = importlib.import_module({name!r})
model, out = package.Model(), []
for one in json.loads({conditions!r}):
    where = package.Condition(**one)
    beat = model.simulation.beat(model.genome(where), model.recording(where))
    out.append([beat.tracks.tolist(), beat.air.tolist()])
print(json.dumps(out))
"""


def conditions(model: CalibratedModel, levels: int) -> list[Condition]:
    """Return ``levels`` flap frequencies, airspeeds and angles of attack within the fitted range, all combined."""
    ranges, middle = {one.name: one for one in model.ranges}, model.middle()
    names = ("flap_frequency", "airspeed", "angle_of_attack")
    grids = [sorted(set(np.linspace(ranges[n].low, ranges[n].high, levels).tolist())) for n in names]
    fixed = {name: getattr(middle, name) for name in ("phase_lag", "pressure", "temperature", "gravity")}
    return [Condition(**dict(zip(names, values, strict=True)), **fixed) for values in product(*grids)]


def vehicle_error(model: CalibratedModel, folder: Path, levels: int = 3) -> float:
    """Return the largest difference (percent of the largest force) of the exported file from wingfit's simulation."""
    file = exported(model, "python")
    (folder / file.name).write_bytes(file.body)
    wanted, own = conditions(model, levels), model.simulation()
    if not isinstance(own, BladeElementWing):
        raise TypeError("not a vehicle")
    text = json.dumps([shown(one) for one in wanted])
    code = VEHICLE_CODE.format(name=file.name.removesuffix(".py"), conditions=text)
    there = run(code, folder, site_of(folder / "site", FILE_NEEDS), cache=folder)
    here = [own.beat([model.genome(one)], blank_forces(one))[0] for one in wanted]
    return _percent([np.array(one) for one in there], here)


def wing_error(model: CalibratedModel, folder: Path, levels: int = 2) -> float:
    """Return the largest difference (percent) of the exported package from wingfit's simulation: tracks and air force.

    Displacements are relative to the largest displacement from rest, forces to the largest force.
    """
    file = exported(model, "python")
    with zipfile.ZipFile(io.BytesIO(file.body)) as archive:
        archive.extractall(folder)
    wanted, own = conditions(model, levels), model.simulation()
    if not isinstance(own, FlexibleWing):
        raise TypeError("not a wing")
    text = json.dumps([one.__dict__ for one in wanted])
    code = WING_CODE.format(name=stem(model), conditions=text)
    there = run(code, folder / stem(model), site_of(folder / "site", PACKAGE_NEEDS), cache=folder / "cache")
    here = [own.beat(model.genome(one), blank_tracks(own.wing, one)) for one in wanted]
    rest = np.array([marker.position for marker in own.wing.markers])
    tracks = _percent([np.array(one[0]) - rest for one in there], [one.tracks - rest for one in here])
    return max(tracks, _percent([np.array(one[1]) for one in there], [one.air for one in here]))


def _percent(there: Sequence[Array], here: Sequence[Array]) -> float:
    apart = max(float(np.abs(one - other).max()) for one, other in zip(there, here, strict=True))
    return 100.0 * apart / max(float(np.abs(one).max()) for one in here)
