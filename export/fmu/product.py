"""What an FMU is made of, before it is compiled."""

from __future__ import annotations

from dataclasses import dataclass

from wingfit.export.fmu.memory import Memory
from wingfit.export.fmu.native import Exported
from wingfit.export.fmu.variables import Limit, Variable
from wingfit.export.formats import FormatError
from wingfit.records.array_types import Array

REFUSED = 3  # exit status of the process that builds, after a NotExportedError whose text is its output


class NotExportedError(FormatError):
    """A model cannot be exported as an FMU, or this machine cannot make one; the text has the remedy."""


@dataclass
class Product:
    """A model ready to be compiled.

    Attributes:
        memory: all its arrays.
        functions: compiled functions by the names of their symbols: ``wingfit_run(memory, dt)`` and
            ``wingfit_law_K(frame, moment)``.
        addresses: pairs (word that holds an address, word that it is the address of).
        laws: pairs (word that holds the address of a law, number of the law).
        board: the array with inputs, parameters and outputs (:mod:`wingfit.export.fmu.kernels.board`).
        variables: in the order of their value references.
        limits: ranges of the inputs in which the model was fitted.
        stop, step: time and communication step that suit the model, s.
        remark: what a user of the FMU must know about it.
    """

    memory: Memory
    functions: dict[str, Exported]
    addresses: list[tuple[int, int]]
    laws: list[tuple[int, int]]
    board: Array
    variables: list[Variable]
    limits: list[Limit]
    stop: float
    step: float
    remark: str = ""
