"""Write a calibrated model as an FMU: a zip file with machine code, its description, and the model."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.fmu.conditions import steps_for
from wingfit.export.fmu.description import identifier
from wingfit.export.fmu.native import environment
from wingfit.export.fmu.product import REFUSED, NotExportedError
from wingfit.export.formats import archive
from wingfit.export.model_file import model_json

_VISIBLE = "{ global: fmi3*; local: *; };\n"
_FLAGS = ("-std=gnu11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off")


def write_fmu(model: CalibratedModel, path: str | os.PathLike[str]) -> None:
    """Write ``model`` to the file ``path`` as an FMU 3.0 for co-simulation on this kind of machine.

    It needs no Python, only the C library. NotExportedError if the model cannot be exported, or if there is no C
    compiler; OSError if the file cannot be written. It takes about 15 s, and two minutes the first time on a machine.
    """
    compiler = c_compiler()
    with tempfile.TemporaryDirectory(prefix="wingfit-fmu-") as place:
        folder = Path(place)
        _build(model, folder)
        shutil.copy(Path(__file__).with_name("interface.c"), folder)
        (folder / "visible.map").write_text(_VISIBLE)
        library = f"{identifier(model)}.so"
        _run(
            [compiler, *_FLAGS, "-Wl,--version-script=visible.map", "-o", library, "interface.c", "model.o", "-lm"],
            folder,
        )
        (folder / "model.json").write_text(model_json(model))
        members = {
            "modelDescription.xml": "modelDescription.xml", f"binaries/{platform_tuple()}/{library}": library,
            "resources/model.json": "model.json", "documentation/index.html": "index.html",
        }  # fmt: skip
        Path(path).write_bytes(archive({name: (folder / source).read_bytes() for name, source in members.items()}))


def c_compiler() -> str:
    """Return the path of a C compiler; NotExportedError if there is none, or if this is no Linux."""
    if platform.system() != "Linux":
        raise NotExportedError(
            f"an FMU can be written on Linux only, and this is {platform.system()}: export on a Linux machine, or in "
            "the Docker image"
        )
    for name in (os.environ.get("CC", ""), "cc", "gcc", "clang"):
        found = shutil.which(name) if name else None
        if found:
            return found
    raise NotExportedError(
        "an FMU contains machine code, and this machine has no C compiler (cc, gcc or clang, or the one named by CC): "
        "install one, such as 'apt install gcc libc6-dev', and export again"
    )


def platform_tuple() -> str:
    """Return the name of this kind of machine in FMI 3.0, such as x86_64-linux."""
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine())
    return f"{machine}-linux"


def _build(model: CalibratedModel, folder: Path) -> None:
    command = [sys.executable, "-m", "wingfit.export.fmu.build", str(folder), str(steps_for(model))]
    done = subprocess.run(  # noqa: S603  (this program)
        command, input=model_json(model), env=environment(), capture_output=True, text=True, check=False
    )
    if done.returncode == REFUSED:
        raise NotExportedError(done.stdout)
    if done.returncode:
        raise RuntimeError(f"the FMU of {model.rig.name!r} could not be compiled:\n{done.stderr[-4000:]}")


def _run(command: list[str], folder: Path) -> None:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode:
        raise NotExportedError(
            f"the C compiler {command[0]} failed: {done.stderr.strip()[-1000:]}\nuse gcc or clang with the headers of "
            "the C library, such as 'apt install gcc libc6-dev'"
        )
