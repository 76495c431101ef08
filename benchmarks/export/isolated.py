"""Run an exported model in a Python that has a few packages only, so that neither wingfit nor scipy can be imported."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

FILE_NEEDS, PACKAGE_NEEDS = ("numpy",), ("numpy", "numba", "llvmlite")
PREAMBLE = """
import json, sys
sys.path[:0] = {places!r}
for name in ("wingfit", "scipy", "pydantic"):
    try:
        __import__(name)
    except ImportError:
        continue
    sys.exit(name + " can be imported, so that nothing is shown")
"""


def site_of(folder: Path, packages: Sequence[str]) -> Path:
    """Make a folder with links to the installed ``packages`` and their shared libraries; return it."""
    folder.mkdir()
    for name in packages:
        spec = importlib.util.find_spec(name)
        if spec is None or not spec.submodule_search_locations:
            raise ValueError(f"package {name} is not installed: install it with pip")
        place = Path(spec.submodule_search_locations[0])
        for found in (place, place.with_name(f"{name}.libs")):
            if found.exists():
                (folder / found.name).symlink_to(found)
    return folder


def run(code: str, *places: Path, cache: Path) -> Any:
    """Run ``code`` in a new process that imports from ``places`` and Python's own library; return its JSON output.

    ``cache``: folder for compiled code. RuntimeError with the output if it fails.
    """
    text = PREAMBLE.format(places=[str(one) for one in places]) + code
    own = {"PATH": os.environ.get("PATH", ""), "NUMBA_CACHE_DIR": str(cache), "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-I", "-S", "-c", text]
    done = subprocess.run(command, capture_output=True, text=True, env=own, check=False)  # noqa: S603  (fixed text)
    if done.returncode:
        raise RuntimeError(f"the exported model fails:\n{done.stdout}{done.stderr}")
    return json.loads(done.stdout.splitlines()[-1])
