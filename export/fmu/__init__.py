"""FMU 3.0 for co-simulation: a calibrated model as machine code that needs no Python (docs/decisions/0034).

The code of the simulation itself is compiled to an object file (:mod:`wingfit.export.fmu.native`), with all its arrays
in one block of memory (:mod:`wingfit.export.fmu.memory`). A C file gives it the interface of FMI 3.0.
"""

from wingfit.export.fmu.package import write_fmu
from wingfit.export.fmu.product import NotExportedError

__all__ = ["NotExportedError", "write_fmu"]
