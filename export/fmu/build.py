"""Write the parts of an FMU to a folder; the program that :func:`wingfit.export.fmu.package.write_fmu` runs.

It runs in a process of its own, because numba then compiles for other processors than this one
(:func:`wingfit.export.fmu.native.environment`), which a process chooses once.
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path

from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.fmu.description import documentation, header, model_description
from wingfit.export.fmu.native import object_file
from wingfit.export.fmu.product import REFUSED, NotExportedError, Product
from wingfit.export.fmu.vehicle import vehicle_product
from wingfit.export.fmu.wing import wing_product
from wingfit.export.model_file import model_from_json


def build(model: CalibratedModel, folder: Path, steps: int) -> None:
    """Write model.o, memory.bin, model.h, modelDescription.xml and index.html to ``folder``."""
    product = product_of(model, steps)
    code, image = object_file(product.functions), product.memory.image()
    token = hashlib.sha256(code + image + repr(product.limits).encode()).hexdigest()
    (folder / "model.o").write_bytes(code)
    (folder / "memory.bin").write_bytes(image)
    (folder / "model.h").write_text(header(product, token))
    (folder / "modelDescription.xml").write_text(model_description(model, product, token))
    (folder / "index.html").write_text(documentation(model, product))


def product_of(model: CalibratedModel, steps: int) -> Product:
    """Return the parts of an FMU of ``model``, with ``steps`` per beat; NotExportedError if there is none."""
    if model.kind == "tracks":
        return wing_product(model, steps)
    if model.kind == "forces":
        return vehicle_product(model)
    raise NotExportedError(
        f"{model.rig.name!r} is simulated by a program of its user, of which wingfit has no code: export that program "
        "as an FMU with its own tool"
    )


def main() -> None:
    """Read a model as JSON from the standard input; build it in the folder given as argument, with the steps given."""
    try:
        build(model_from_json(sys.stdin.read()), Path(sys.argv[1]), int(sys.argv[2]))
    except NotExportedError as error:
        sys.stdout.write(str(error))
        sys.exit(REFUSED)


if __name__ == "__main__":
    main()
