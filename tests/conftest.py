"""What all tests share."""

from __future__ import annotations

import os

from hypothesis import settings
from jaxtyping import install_import_hook

from tests import shapes

# Packages whose annotations are checked at every call (docs/decisions/0017-array-shapes.md).
install_import_hook(["wingfit.records", "wingfit.inference", "wingfit.diagnosis"], f"{shapes.__name__}.checked")

# Continuous integration draws the same examples every time; elsewhere new ones are looked for.
settings.register_profile("ci", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("ci")
