"""Write a calibrated vehicle as one Python file that needs numpy alone."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Mapping
from pprint import pformat

from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.python.bundle import collect, source_of
from wingfit.sim.effects import registry
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing

RUNTIME = "wingfit.export.runtime.vehicle"
REGISTRY = "wingfit.sim.effects.registry"
OWN = "wingfit.export.python"
# Modules of wingfit whose place another one takes in the file.
IN_PLACE_OF: Mapping[str, str] = {
    "wingfit.records.array_types": f"{OWN}.array_types",
    "wingfit.records.blas_threads": f"{OWN}.blas_threads",
    "wingfit.sim.kernels.jit": f"{OWN}.numpy_kernels.jit",
    "wingfit.sim.kernels.lanes.vector": f"{OWN}.numpy_kernels.vector",
    "wingfit.sim.kernels.laws": f"{OWN}.numpy_kernels.laws",
}
FILTERING = "wingfit.sim.filtering"
# They compute the instants of a beat beside each other, which numpy does for all of them at once.
WHOLE_BEAT = ("wingfit.sim.vehicle.elements", "wingfit.sim.vehicle.blade_element_wing")
LINE = 110


def vehicle_file(model: CalibratedModel) -> str:
    """Return the text of the Python file of ``model``; ValueError if it is not one of a vehicle."""
    vehicle, simulation = model.vehicle, model.simulation()
    if not isinstance(simulation, BladeElementWing):
        raise TypeError("a vehicle is simulated by blade elements")
    folders = effect_folders(model.settings.effects)
    settings = (simulation.terms, simulation.elements, simulation.instants, simulation.peel_width, simulation.effects)
    body = VEHICLE_BODY.format(
        vehicle=pformat(vehicle, width=LINE, sort_dicts=False),
        calibrated=pformat(model.calibrated, width=LINE, sort_dicts=False),
        settings=repr(settings),
    )
    starts = [RUNTIME, "wingfit.export.runtime.command_line", *folders]
    return bundled(model, starts, folders, body, VEHICLE_ABOUT, simulation.instants)


def bundled(
    model: CalibratedModel, starts: list[str], folders: tuple[str, ...], body: str, about: str, instants: int = 8
) -> str:
    """Return the text of a file with the modules ``starts`` and all that they import, in front of ``body``.

    ``folders``: modules of its effects; ``about``: how to use the file; ``body`` names the package {package}.
    """
    package = f"_wingfit_model_{hashlib.sha256(repr(model).encode()).hexdigest()[:12]}"
    modules = collect(starts, _replaced(instants, folders), package)
    return TEMPLATE.format(
        title=title(model),
        about=about.strip(),
        package=package,
        modules="".join(f"    {name!r}: {_quoted(source)},\n" for name, source in modules.items()),
        body=body.replace("{package}", package),
    )


def effect_folders(effects: Iterable[str]) -> tuple[str, ...]:
    """Return the modules of the library that define ``effects``, in the registry's order."""
    modules = {
        EFFECT.name: f"wingfit.sim.effects.library.{folder}.{name}"
        for folder, names in registry.FILES
        for name in names.split()
        for EFFECT in [registry.EFFECTS[name]]
    }
    return tuple(module for name, module in modules.items() if name in set(effects))


def registry_of(modules: Iterable[str]) -> str:
    """Return the source of the registry of effects with those of ``modules`` only."""
    source = source_of(REGISTRY)
    files = tuple(tuple(module.split(".")[-2:]) for module in modules)
    (node,) = (
        node
        for node in ast.parse(source).body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id == "FILES"
    )
    lines = source.splitlines(keepends=True)
    lines[node.lineno - 1 : node.end_lineno] = [f"FILES = {files!r}\n"]
    return "".join(lines)


def title(model: CalibratedModel) -> str:
    """Return what the model is and where it comes from, as text for its first lines."""
    source = model.provenance
    commit = f", commit {source.commit}" if source.commit else ""
    digest = f" (SHA-256 {source.dataset_sha256})" if source.dataset_sha256 else ""
    ranges = "; ".join(f"{one.name} {one.low:.6g} to {one.high:.6g} {one.unit}" for one in model.ranges)
    fit = "unknown" if model.misfit is None else f"{model.misfit:.4g} {model.misfit_unit}"
    noise = "unknown" if model.noise is None else f"{model.noise:.4g} {model.misfit_unit}"
    lines = [
        f"Calibrated model of {model.rig.name!r}: {source.source}.",
        "",
        f"From {source.origin} {source.id} ({source.name!r}) on dataset {source.dataset!r}{digest},",
        f"written by wingfit {source.wingfit_version}{commit} at {source.created_at}; seed {source.seed}.",
        f"Misfit {fit}; noise {noise}. Effects: {', '.join(model.settings.effects) or 'none'}.",
        f"Fitted range: {ranges}.",
        *(f"Remark: {remark}" for remark in model.remarks),
    ]
    return "\n".join(_harmless(line) for line in lines)


def _harmless(line: str) -> str:
    """Return ``line``, which may hold names given by anybody, so that it neither ends nor breaks a text literal."""
    printable = "".join(one if one.isprintable() else " " for one in line)
    return printable.replace("\\", "/").replace('"', "'")


def _replaced(instants: int, folders: Iterable[str]) -> dict[str, str]:
    found = {name: source_of(other) for name, other in IN_PLACE_OF.items()}
    found["wingfit.sim.kernels"] = "LANES = 8  # stations along a wing\n"
    for name in WHOLE_BEAT:
        found[name] = _replace(source_of(name), "from wingfit.sim.kernels import LANES\n", f"LANES = {instants}\n")
    # A prediction is not filtered, and the low-pass of recordings needs scipy.
    found[FILTERING] = _replace(source_of(FILTERING), "import scipy\n", "scipy = None\n")
    found[REGISTRY] = registry_of(folders)
    return found


def _replace(source: str, old: str, new: str) -> str:
    if source.count(old) != 1:
        raise ValueError(f"the source to be copied has {old.strip()!r} {source.count(old)} times, not once")
    return source.replace(old, new)


def _quoted(source: str) -> str:
    """Return ``source`` as a raw text literal."""
    if "'''" in source or source.endswith("\\"):
        return repr(source)
    return f"r'''{source}'''"


TEMPLATE = '''#!/usr/bin/env python3
"""{title}

{about} The code of wingfit in it is under the MIT licence.
"""

import importlib.abc
import importlib.machinery
import linecache
import sys

# The simulation: source of its modules, by name.
MODULES = {{
{modules}}}


class _Modules(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Imports the modules above as the package {package}."""

    package = "{package}"

    def find_spec(self, fullname, path=None, target=None):
        """Return how to load one of the modules; None for any other."""
        if fullname.split(".")[0] != self.package:
            return None
        name = fullname.removeprefix(self.package).removeprefix(".")
        if name not in MODULES:
            return None
        inner = not name or any(one.startswith(name + ".") for one in MODULES)
        return importlib.machinery.ModuleSpec(fullname, self, is_package=inner)

    def create_module(self, spec):
        """Let Python make an empty module."""
        return None

    def exec_module(self, module):
        """Run the source of ``module``; it is shown in tracebacks."""
        source = MODULES[module.__name__.removeprefix(self.package).removeprefix(".")]
        place = f"<{{module.__name__}}>"
        linecache.cache[place] = (len(source), None, source.splitlines(keepends=True), place)
        exec(compile(source, place, "exec"), module.__dict__)


if not any(getattr(one, "package", "") == _Modules.package for one in sys.meta_path):
    sys.meta_path.insert(0, _Modules())

{body}'''

VEHICLE_ABOUT = """
    from model import Model
    found = Model().forces(flap_frequency_hz=12.0)      # found.force_n [n, 2], found.mean_n, found.interval()

or on the command line: python model.py --help. Conditions outside the fitted range are refused, unless
extrapolate=True (--extrapolate). The file needs Python 3.11 and numpy.
"""

VEHICLE_BODY = '''from {{package}}.export.runtime.command_line import run  # noqa: E402
from {{package}}.export.runtime.conditions import OutsideRangeError  # noqa: E402, F401
from {{package}}.export.runtime.parts import (  # noqa: E402, F401
    Calibrated,
    Covariance,
    FittedRange,
    FittedRecording,
    Parameter,
    Provenance,
)
from {{package}}.export.runtime.vehicle import Forces, VehicleModel  # noqa: E402, F401
from {{package}}.records.dataset import Condition  # noqa: E402, F401
from {{package}}.records.vehicle import (  # noqa: E402, F401
    ChordStation,
    FourierFlap,
    FourierPitch,
    PassivePitch,
    SplitCycleFlap,
    Vehicle,
    WingMotion,
)

VEHICLE = {vehicle}

CALIBRATED = {calibrated}

SETTINGS = {settings}  # terms, elements, instants, peel width, effects


class Model(VehicleModel):
    """The calibrated model; see the text at the top of this file."""

    def __init__(self):
        super().__init__(VEHICLE, *SETTINGS, CALIBRATED)


if __name__ == "__main__":
    sys.exit(run(CALIBRATED, Model().forces))
'''
