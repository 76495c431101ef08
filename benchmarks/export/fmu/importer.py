"""Run an FMU with FMPy, and with a small importer in C in a process without Python."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from wingfit.export.fmu.package import c_compiler, platform_tuple
from wingfit.records.array_types import Array

DRIVER = Path(__file__).with_name("driver.c")


class Fmu:
    """An FMU, unpacked for FMPy until the end of a ``with`` block."""

    def __init__(self, path: Path) -> None:
        import fmpy

        self.path, self.description = path, fmpy.read_model_description(str(path))
        self.folder = tempfile.mkdtemp(prefix="wingfit-fmpy-")
        fmpy.extract(str(path), self.folder)
        self.references = {one.name: int(one.valueReference) for one in self.description.modelVariables}

    def __enter__(self) -> Fmu:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)

    @property
    def library(self) -> Path:
        """The FMU's machine code."""
        name = self.description.coSimulation.modelIdentifier
        return Path(self.folder, "binaries", platform_tuple(), f"{name}.so")

    def started(self, values: Mapping[str, float], extrapolate: bool = False) -> Running:
        """Return an instance, initialized with the ``values`` of inputs and parameters."""
        found = Running(self)
        found.slave.instantiate(loggingOn=True, logMessage=found.logger)
        found.set(values)
        found.slave.setBoolean([self.references["extrapolate"]], [extrapolate])
        found.slave.enterInitializationMode()
        found.slave.exitInitializationMode()
        return found

    def by_driver(self, values: Mapping[str, float], outputs: Sequence[str], dt: float, count: int) -> Driven:
        """Return what the importer in C finds; RuntimeError with its message if it fails."""
        program = Path(self.folder, "driver")
        command = [c_compiler(), "-O1", "-o", str(program), str(DRIVER), "-ldl"]
        subprocess.run(command, check=True, capture_output=True)  # noqa: S603
        wanted = ",".join(str(self.references[name]) for name in outputs)
        given = [f"{self.references[name]}={value!r}" for name, value in values.items()]
        done = subprocess.run(  # noqa: S603
            [str(program), str(self.library), self.description.guid, repr(dt), str(count), wanted, *given],
            capture_output=True, text=True, check=False, env={},
        )  # fmt: skip
        if done.returncode:
            raise RuntimeError(f"the importer in C fails: {done.stderr}")
        *lines, restored, python = done.stdout.splitlines()
        rows = [[float.fromhex(word) for word in line.split()] for line in lines]
        return Driven(np.array(rows), restored == "identical", python == "python")


@dataclass(frozen=True)
class Driven:
    """Outputs [count, N] after every step, whether the state was restored exactly, and whether Python was loaded."""

    outputs: Array
    identical: bool
    python: bool


@dataclass
class Running:
    """An instance of an FMU in this process."""

    fmu: Fmu
    time: float = 0.0
    messages: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        import fmpy.fmi3

        described = self.fmu.description
        self.slave: Any = fmpy.fmi3.FMU3Slave(
            guid=described.guid, unzipDirectory=self.fmu.folder, instanceName="wing",
            modelIdentifier=described.coSimulation.modelIdentifier,
        )  # fmt: skip

    def logger(self, *message: Any) -> None:
        """Keep a message of the FMU; its text is the last argument."""
        self.messages.append(message[-1].decode())

    def set(self, values: Mapping[str, float]) -> None:
        """Set inputs, or parameters before the start."""
        for name, value in values.items():
            self.slave.setFloat64([self.fmu.references[name]], [value])

    def step(self, dt: float) -> None:
        """Advance by ``dt`` seconds; FMICallException if the FMU refuses."""
        self.slave.doStep(self.time, dt)
        self.time += dt

    def get(self, names: Sequence[str]) -> Array:
        """Return the values of the variables ``names``."""
        return np.array(self.slave.getFloat64([self.fmu.references[name] for name in names]))

    def series(self, names: Sequence[str], dt: float, count: int) -> Array:
        """Return the values [count, N] before each of ``count`` steps of ``dt`` seconds."""
        found = np.empty((count, len(names)))
        for k in range(count):
            found[k] = self.get(names)
            self.step(dt)
        return found

    def close(self) -> None:
        """End the instance."""
        self.slave.terminate()
        self.slave.freeInstance()
