"""What all tests share."""

from __future__ import annotations

import os

from hypothesis import settings

# Continuous integration draws the same examples every time; elsewhere new ones are looked for.
settings.register_profile("ci", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("ci")
