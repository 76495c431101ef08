"""One instance of an FMU for co-simulation, with the same calls for FMI 2.0 and 3.0."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from wingfit.records.array_types import Array
from wingfit.rigs.doors.door import DoorError, short

REAL = {"2": "Real", "3": "Float64"}  # type of the variables that are used, by version of FMI
FATAL = 4  # status after which an instance must not be called any more
ERROR = 3
KEPT_MESSAGES = 20


class Variables(NamedTuple):
    """The FMU's variable for each channel, for each gene or setting, and for each input."""

    channels: dict[str, str]
    parameters: dict[str, str]
    inputs: dict[str, str]


def load(file: str, folder: str, variables: Variables) -> Callable[[], Instance]:
    """Unpack ``file`` to ``folder`` and return what makes an instance; DoorError where that is impossible."""
    try:
        import fmpy
        from fmpy.simulation import instantiate_fmu
    except ImportError as error:
        raise DoorError("FMPy is not installed, which simulates FMUs; pip install 'wingfit[fmu]'") from error
    if not Path(file).is_file():
        raise DoorError(f"there is no FMU {file}; give the path of the file, which must be the same on every machine")
    if not zipfile.is_zipfile(file):
        raise DoorError(f"{file} is no FMU: it is not a zip file; export the model again")
    try:
        description = fmpy.read_model_description(file, validate=False)
        fmpy.extract(file, folder)
    except Exception as error:  # FMPy's own errors share no base class
        raise DoorError(f"{file} cannot be read as an FMU: {short(str(error))}; export the model again") from error
    version = str(description.fmiVersion)[:1]
    if version not in REAL or description.coSimulation is None:
        raise DoorError(
            f"{Path(file).name} is FMI {description.fmiVersion}, {_kinds(description)}; export it for "
            "co-simulation, as FMI 2.0 or 3.0"
        )
    references = _references(description, variables, REAL[version])

    def make() -> Instance:
        messages: list[str] = []
        try:
            made = instantiate_fmu(
                folder,
                description,
                "CoSimulation",
                logger=_logger(messages, version),
            )
        except Exception as error:
            have = fmpy.supported_platforms(file)
            wanted = {fmpy.platform, fmpy.platform_tuple}
            remedy = "export it again, with all functions of FMI"
            if not wanted & set(have):
                remedy = f"it holds code for {', '.join(have) or 'no platform'}: export it for {fmpy.platform}"
            said = short(" / ".join([str(error), *messages]))
            raise DoorError(f"{Path(file).name} cannot be instantiated ({said}); {remedy}") from error
        return Instance(made, version, description, references, messages)

    return make


class References(NamedTuple):
    """Value references of the channels, of the parameters by the name of the variable, and of the inputs."""

    channels: list[int]
    parameters: dict[str, int]
    inputs: list[int]


class Instance:
    """An instance of an FMU, as new until :meth:`begin`."""

    def __init__(self, made: Any, version: str, description: Any, references: References, messages: list[str]) -> None:
        from fmpy.fmi1 import FMICallException

        self.failure = FMICallException
        self.messages = messages
        self._made, self._version, self._references = made, version, references
        able = description.coSimulation
        self.even = not able.canHandleVariableCommunicationStepSize
        self.interpolates = version == "2" and bool(able.canInterpolateInputs) and bool(references.inputs)
        self._set = made.setReal if version == "2" else made.setFloat64
        self._get = made.getReal if version == "2" else made.getFloat64

    def begin(self, values: Mapping[str, float], start: float, tolerance: float | None) -> None:
        """Set the parameters to ``values`` by name of the variable, and begin the initialisation at ``start`` (s)."""
        self.messages.clear()
        if values:
            self._set([self._references.parameters[name] for name in values], list(values.values()))
        if self._version == "2":
            self._made.setupExperiment(tolerance=tolerance, startTime=start)
            self._made.enterInitializationMode()
        else:
            self._made.enterInitializationMode(tolerance=tolerance, startTime=start)

    def finish_start(self) -> None:
        """End the initialisation."""
        self._made.exitInitializationMode()

    def set_inputs(self, values: Array) -> None:
        """Set the inputs to ``values`` [U]."""
        if len(values):
            self._set(self._references.inputs, values.tolist())

    def set_slopes(self, slopes: Array) -> None:
        """Set the rate of change of the inputs, ``slopes`` [U], for the next step."""
        self._made.setRealInputDerivatives(self._references.inputs, [1] * len(slopes), slopes.tolist())

    def advance(self, time: float, step: float) -> None:
        """Simulate from ``time`` for ``step`` (s)."""
        found = self._made.doStep(time, step)
        if self._version == "3":
            _, ended, early, reached = found
            if ended or (early and reached < time + step * (1.0 - 1e-9)):
                raise self.failure("fmi3DoStep", ERROR)

    def outputs(self) -> Sequence[float]:
        """Return the channels [C]."""
        found: Sequence[float] = self._get(self._references.channels)
        return found

    def reset(self) -> bool:
        """Make the instance as new; whether it can do that."""
        try:
            self._made.reset()
        except Exception:  # of FMPy, or a function that the FMU lacks
            return False
        return True

    @staticmethod
    def may_be_freed(error: Exception) -> bool:
        """Return whether the instance may still be called after ``error``."""
        return bool(getattr(error, "status", FATAL) != FATAL)

    def free(self) -> None:
        """Free the instance; it must not be used afterwards."""
        with suppress(Exception):  # of FMPy or the FMU: it is given up anyway
            self._made.freeInstance()


def _kinds(description: Any) -> str:
    named = {
        "coSimulation": "co-simulation",
        "modelExchange": "model exchange",
        "scheduledExecution": "scheduled execution",
    }
    return (
        " and ".join(words for name, words in named.items() if getattr(description, name, None)) or "of no known kind"
    )


def _references(description: Any, variables: Variables, real: str) -> References:
    known = {variable.name: variable for variable in description.modelVariables}

    def one(name: str, causalities: tuple[str, ...], what: str) -> int:
        a = "a" if what == "parameter" else "an"
        if name not in known:
            near = ", ".join(sorted(n for n, v in known.items() if v.causality in causalities)[:20]) or "none"
            raise DoorError(f"the FMU has no variable {name!r}; its {what}s are {near}")
        variable = known[name]
        if variable.type != real or variable.dimensions or variable.dimensionValueReferences:
            raise DoorError(f"variable {name!r} of the FMU is {variable.type}; name {a} {what} that is a single {real}")
        if what != "output" and variable.causality not in causalities:
            raise DoorError(f"variable {name!r} of the FMU is of causality {variable.causality}; name {a} {what}")
        if what == "parameter" and variable.variability == "constant":
            raise DoorError(f"variable {name!r} of the FMU is constant; name a parameter that can be set")
        return int(variable.valueReference)

    return References(
        [one(name, ("output", "local"), "output") for name in variables.channels.values()],
        {name: one(name, ("parameter", "local", "output"), "parameter") for name in variables.parameters.values()},
        [one(name, ("input",), "input") for name in variables.inputs.values()],
    )


def _logger(messages: list[str], version: str) -> Callable[..., None]:
    """Return what the FMU calls with a message: its last argument is the text."""
    del version

    def log(*arguments: Any) -> None:
        text = arguments[-1]
        messages.append(text.decode(errors="replace") if isinstance(text, bytes) else str(text))
        del messages[:-KEPT_MESSAGES]

    return log
