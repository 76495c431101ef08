"""Checks of datasets that look at the physics: axes, units, frequency, drive, forces. See docs/checks.md."""

from wingfit.checks.examine import CHECKS, Check, examine
from wingfit.checks.load import DatasetWarning, check_archive, check_dataset, load_dataset
from wingfit.checks.mistake import Mistake

__all__ = ["CHECKS", "Check", "DatasetWarning", "Mistake", "check_archive", "check_dataset", "examine", "load_dataset"]
