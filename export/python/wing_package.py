"""Write a calibrated wing as a Python package that needs numpy and numba, but no wingfit."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from pprint import pformat

from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.python.bundle import collect, source_of
from wingfit.export.python.vehicle_file import LINE, OWN, REGISTRY, effect_folders, registry_of, title

RUNTIME = "wingfit.export.runtime.wing"
SIMULATION = "_simulation"


def wing_package(model: CalibratedModel, name: str) -> dict[str, str]:
    """Return the files of the package ``name`` of ``model``, by path; ValueError if it is not one of a wing."""
    wing, settings = model.wing, model.settings
    folders = effect_folders(settings.effects)
    replaced = {
        "wingfit.records.array_types": source_of(f"{OWN}.array_types"),
        "wingfit.records.blas_threads": source_of(f"{OWN}.blas_threads"),
        REGISTRY: registry_of(folders),
    }
    starts = [RUNTIME, "wingfit.export.runtime.command_line", *folders]
    modules = collect(starts, replaced, f"{name}.{SIMULATION}")
    packages = {module.rpartition(".")[0] for module in modules}
    files = {
        "pyproject.toml": PROJECT.format(name=name.replace("_", "-"), package=name),
        "LICENSE": license_text(),
        "README.md": README.format(name=name, title=title(model)),
        f"{name}/__init__.py": INIT.format(
            title=title(model),
            simulation=SIMULATION,
            wing=pformat(wing, width=LINE, sort_dicts=False),
            calibrated=pformat(model.calibrated, width=LINE, sort_dicts=False),
            settings=repr((settings.division, settings.bounds_factor, settings.accuracy, settings.effects)),
        ),
        f"{name}/__main__.py": MAIN.format(name=name, simulation=SIMULATION),
    }
    for module, source in modules.items():
        path = "/".join([name, SIMULATION, *filter(None, module.split("."))])
        files[f"{path}/__init__.py" if module in packages or not module else f"{path}.py"] = source
    return files


def license_text() -> str:
    """Return the licence of wingfit, whose code a package contains."""
    beside = Path(__file__).resolve().parents[2] / "LICENSE"
    if beside.is_file():
        return beside.read_text()
    try:
        installed = distribution("wingfit")
    except PackageNotFoundError:
        installed = None
    found = installed and (installed.read_text("licenses/LICENSE") or installed.read_text("LICENSE"))
    if not found:
        raise ValueError("the licence of wingfit is missing from its installation: install it again")
    return found


PROJECT = """[build-system]
requires = ["setuptools>=77"]
build-backend = "setuptools.build_meta"

[project]
name = "{name}"
version = "1.0.0"
description = "A calibrated model of a flapping wing"
readme = "README.md"
requires-python = ">=3.11"
license = "MIT"
dependencies = ["numba>=0.61", "numpy>=2.0"]

[project.scripts]
{name} = "{package}.__main__:main"

[tool.setuptools.packages.find]
include = ["{package}*"]
"""

README = """# {name}

{title}

Install it with `pip install .`, or run it in this folder:

```sh
python -m {name} --about
python -m {name} --no-intervals
```

```python
from {name} import Model

found = Model().motion(flap_frequency_hz=3.0)   # position_m [n, M, 3], air_force_n, rod_moment_n_m, interval()
time, position = Model().transient(5)           # from rest
```

The first call compiles the simulation, which takes a minute. Conditions outside the fitted range are refused, unless
`extrapolate=True` (`--extrapolate`).
"""

INIT = '''"""{title}

    from this package import Model
    found = Model().motion(flap_frequency_hz=3.0)      # found.position_m [n, M, 3], found.interval()

Conditions outside the fitted range are refused, unless extrapolate=True.
"""

from .{simulation}.export.runtime.conditions import OutsideRangeError  # noqa: F401
from .{simulation}.export.runtime.parts import (  # noqa: F401
    Calibrated,
    Covariance,
    FittedRange,
    FittedRecording,
    Parameter,
    Provenance,
)
from .{simulation}.export.runtime.wing import Motion, WingModel  # noqa: F401
from .{simulation}.records.dataset import Condition  # noqa: F401
from .{simulation}.records.drive import FourBarDrive, FourierDrive  # noqa: F401
from .{simulation}.records.wing import (  # noqa: F401
    Hinge,
    Marker,
    Materials,
    Rod,
    Station,
    Wing,
)

WING = {wing}

CALIBRATED = {calibrated}

SETTINGS = {settings}  # division, bounds factor, accuracy (m), effects


class Model(WingModel):
    """The calibrated model; see the text at the top of this file."""

    def __init__(self):
        super().__init__(WING, *SETTINGS, CALIBRATED)
'''

MAIN = '''"""The command line of the model: python -m {name} --help."""

import sys

from . import CALIBRATED, Model
from .{simulation}.export.runtime.command_line import run


def main():
    """Print one prediction, and exit."""
    sys.exit(run(CALIBRATED, Model().motion))


if __name__ == "__main__":
    main()
'''
