"""What all tests share."""

from __future__ import annotations

import os

import scipy.linalg  # noqa: F401  which has a BLAS of its own
from hypothesis import settings
from jaxtyping import install_import_hook
from threadpoolctl import threadpool_limits

from tests import shapes

# Tests run beside each other, and BLAS threads that wait for a processor spin: up to ten times the work. This process
# only: the product does without in its own (tests/workers/test_blas_threads.py).
threadpool_limits(1, user_api="blas")

# Packages whose annotations are checked at every call (docs/decisions/0017-array-shapes.md).
if not os.environ.get("UNCHECKED_SHAPES"):
    install_import_hook(["wingfit.records", "wingfit.inference", "wingfit.diagnosis"], f"{shapes.__name__}.checked")

# Continuous integration draws the same examples every time; elsewhere new ones are looked for.
settings.register_profile("ci", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("ci")
