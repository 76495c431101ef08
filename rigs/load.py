"""Find the rig of a user: in a Python file, in a module, or as an installed plug-in (entry points "wingfit.rigs")."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import sys
from collections.abc import Mapping
from dataclasses import replace
from importlib.machinery import SourceFileLoader
from importlib.metadata import entry_points
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

from wingfit.rigs.rig import Rig

GROUP = "wingfit.rigs"
ATTRIBUTE = "rig"


class RigError(ValueError):
    """Raised where a rig cannot be loaded; the message says what to do."""


def plug_ins() -> tuple[str, ...]:
    """Return the names of the installed rigs: entry points of the group "wingfit.rigs"."""
    return tuple(sorted(one.name for one in entry_points(group=GROUP)))


def load_rig(reference: str) -> Rig:
    """Return the rig that ``reference`` names; RigError if there is none.

    ``reference``: a Python file ("my_rig.py"), a module and an attribute ("package.module:rig"), or the name of a
    plug-in. Without an attribute it is ``rig``; a file may be followed by ":attribute" as well. Files and modules are
    run: load only what you trust.
    """
    place, _, attribute = reference.partition(":") if ".py:" in reference or ":" in reference else (reference, "", "")
    if place.endswith(".py"):
        found = getattr(_module_of(Path(place)), attribute or ATTRIBUTE, None)
    elif attribute:
        found = getattr(_imported(place), attribute, None)
    else:
        known = {one.name: one for one in entry_points(group=GROUP)}
        if reference not in known:
            have = ", ".join(known) or "none is installed"
            raise RigError(
                f"there is no rig {reference!r}: give a Python file (my_rig.py), a module and attribute "
                f"(package.module:rig), or the name of a plug-in ({have})"
            )
        found = known[reference].load()
    if not isinstance(found, Rig):
        what = attribute or ATTRIBUTE
        held = "nothing" if found is None else f"a {type(found).__name__}"
        raise RigError(f"{reference} holds {held} called {what!r}; define there: {what} = wingfit.Rig(...)")
    return replace(found, reference=reference)


def reload_rig(values: Mapping[str, Any]) -> Rig:
    """Return the rig with the fields ``values`` by name, and the function of the rig that its reference names."""
    return replace(load_rig(values["reference"]), **values)


def _module_of(path: Path) -> ModuleType:
    """Run the file ``path``, once as long as its contents stay the same, and return its module."""
    if not path.is_file():
        raise RigError(f"there is no file {path}; give the path of the Python file that defines the rig")
    text = path.read_bytes()
    name = f"wingfit_rig_{path.stem}_{hashlib.sha256(str(path.resolve()).encode() + text).hexdigest()[:12]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path, loader=_FromSource(name, str(path)))
    if spec is None or spec.loader is None:
        raise RigError(f"{path} cannot be read as a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        raise RigError(f"{path} fails when it is run: {type(error).__name__}: {error}") from error
    return module


class _FromSource(SourceFileLoader):
    """Compiles a file at every load: Python would take the compiled copy of one that was changed in the same second."""

    def get_code(self, fullname: str) -> CodeType:
        """Return the code of the file as it is now."""
        path = self.get_filename(fullname)
        return self.source_to_code(self.get_data(path), path)


def _imported(name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise RigError(
            f"module {name!r} cannot be imported: {error}; install it, or give the path of its file"
        ) from error
