"""FMUs of the oscillator, built from C."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest

SOURCE = Path(__file__).parent / "programs" / "oscillator_fmu.c"
VARIABLES = (  # name, causality, variability, start value, in the order of the value references
    ("position", "output", "continuous", ""),
    ("speed", "output", "continuous", ""),
    ("force", "input", "continuous", "0"),
    ("mass", "parameter", "fixed", "1"),
    ("k", "parameter", "fixed", "20"),
    ("damping", "parameter", "fixed", "0.3"),
    ("start", "parameter", "fixed", "0.1"),
)


def built(folder: Path, version: int, *macros: str, interpolates: bool = False, kind: str = "CoSimulation") -> Path:
    """An FMU of FMI ``version`` in ``folder``; skips the test where it cannot be built or simulated here."""
    gcc = shutil.which("gcc") or shutil.which("cc")
    if gcc is None:
        pytest.skip("there is no C compiler (gcc), with which the FMU of this test is built")
    if importlib.util.find_spec("fmpy") is None:
        pytest.skip("FMPy is not installed: pip install 'wingfit[fmu]'")
    import fmpy

    platform = fmpy.platform if version == 2 else fmpy.platform_tuple
    name = f"oscillator{version}{''.join(macros).lower()}{interpolates}{kind}"
    library = folder / f"{name}{fmpy.sharedLibraryExtension}"
    flags = [f"-DFMI={version}", *(f"-D{macro}" for macro in macros)]
    subprocess.run([gcc, "-O1", "-shared", "-fPIC", *flags, "-o", library, SOURCE, "-lm"], check=True)
    description = (_fmi2 if version == 2 else _fmi3)(name, "EVEN" not in macros, interpolates, kind)
    file = folder / f"{name}.fmu"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(library, f"binaries/{platform}/{library.name}")
    return file


def _fmi2(name: str, any_step: bool, interpolates: bool, kind: str) -> str:
    rows = "".join(
        f'<ScalarVariable name="{one}" valueReference="{k}" causality="{causality}" variability="{variability}"><Real'
        + (f' start="{start}"' if start else "")
        + "/></ScalarVariable>"
        for k, (one, causality, variability, start) in enumerate(VARIABLES)
    )
    rows += (
        '<ScalarVariable name="count" valueReference="9" causality="parameter" variability="fixed"><Integer start="1"/>'
        "</ScalarVariable>"
    )
    able = (
        f'canHandleVariableCommunicationStepSize="{_word(any_step)}" canInterpolateInputs="{_word(interpolates)}"'
        if kind == "CoSimulation"
        else ""
    )
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0" modelName="oscillator" '
        f'guid="{{oscillator}}"><{kind} modelIdentifier="{name}" {able}/><ModelVariables>{rows}</ModelVariables>'
        '<ModelStructure><Outputs><Unknown index="1"/><Unknown index="2"/></Outputs></ModelStructure>'
        "</fmiModelDescription>"
    )


def _fmi3(name: str, any_step: bool, interpolates: bool, kind: str) -> str:
    assert not interpolates, "FMI 3.0 has no derivatives of inputs"
    rows = "".join(
        f'<Float64 name="{one}" valueReference="{k}" causality="{causality}" variability="{variability}"'
        + (f' start="{start}"' if start else "")
        + "/>"
        for k, (one, causality, variability, start) in enumerate(VARIABLES)
    )
    rows += '<Int32 name="count" valueReference="9" causality="parameter" variability="fixed" start="1"/>'
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="3.0" modelName="oscillator" '
        f'instantiationToken="{{oscillator}}"><{kind} modelIdentifier="{name}" '
        f'canHandleVariableCommunicationStepSize="{_word(any_step)}"/><ModelVariables>{rows}</ModelVariables>'
        '<ModelStructure><Output valueReference="0"/><Output valueReference="1"/></ModelStructure>'
        "</fmiModelDescription>"
    )


def _word(value: bool) -> str:
    return "true" if value else "false"
